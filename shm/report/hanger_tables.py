"""The tables of a report, as headings and rows of texts: one source for terminal and HTML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shm.models.classes import equal_springs
from shm.models.practice_formulas import FORMULAS
from shm.report import formatting, shared_tables
from shm.report.bar_table import NOT_STATED
from shm.report.contents import HangerReport, TrendRow
from shm.report.control_report import limits, percent
from shm.report.formatting import Interval
from shm.report.paper import Table
from shm.report.shared_tables import lineage, quality_table
from shm.report.shifts import shift_cells, shift_table
from shm.report.states import StatesOverTime
from shm.values import (
    PLANES,
    WITHOUT_MODEL,
    Alert,
    FloatArray,
    Mode,
    PredictedFrequency,
    TemperatureCoefficient,
    kind_of,
)
from shm.values.messages import Lead
from shm.values.rounding import ForceUnit, force_unit
from shm.values.stated_tension import stated
from shm.watch.control_chart import ControlChart


def changes(data: HangerReport) -> Table:
    """Return the change of each quantity since the baseline, with its threshold."""
    tests = f" of {formatting.counted_tests(data.baseline.tests)}" if data.baseline else ""
    return Table(
        f"Changes since the baseline{tests}",
        ("quantity", "change", "90 % interval", "threshold", "probability beyond it"),
        tuple(map(shift_cells, data.drifts)),
        note=f"At equal temperature, if anything changed at all. {data.drift_watch}".strip(),
    )


def temperatures(data: HangerReport) -> Table:
    return temperature_table(data.states)


_EXACT = 1e-5  # of a formula: far below what a frequency tells
_NEXT_TO = 2  # hangers on either side, which take up most of a lost load
_ROWS_SHOWN = 12  # layout: what a page holds
_ALERTS_SHOWN = 5  # layout: a third of a page
_EARLIER = "... and {} earlier ones (in HTML and JSON)"
_IRREGULAR = (
    " Not followed: the mode is well off the bar that the others follow, as if the hanger sagged "
    "or had lost section; no tension is inferred from it. For the cause: shm gap diagnose."
)


def neighbours(data: HangerReport) -> Table:
    """Return the hanger and two to either side; empty where nothing is called."""
    title, pattern = "The hangers beside it", data.neighbours
    rows = pattern.rows if pattern else ()
    place = next((row.place for row in rows if row.hanger == data.hanger.id), None)
    if pattern is None or place is None:
        return Table(title, (), ())
    near = tuple(row for row in rows if abs(row.place - place) <= _NEXT_TO)
    made = shift_table(replace(pattern, rows=near, not_compared=()))
    wording = " ".join((pattern.sentence, *pattern.remarks))
    note = f"{wording} The whole bridge: shm report --bridge."
    return replace(made, title=title, note=note)


def frequencies(data: HangerReport) -> Table:
    measured = {(mode.plane, mode.order): mode for mode in data.latest.modes}
    misfits = {(mode.plane, mode.order): off for mode, off in data.misfits_percent}
    return Table(
        "Frequencies",
        (
            "plane", "mode", "measured, Hz", "sd, Hz", "predicted, Hz",
            "90 % credible interval, Hz",
            "off, % (90 % interval)",
        ),
        (
            *(_irregular_row(mode) for mode in _irregular(data)),
            *(
                _frequency_row(
                    mode,
                    measured.get((mode.plane, mode.order)),
                    misfits.get((mode.plane, mode.order)),
                )
                for mode in data.predicted
            ),
        ),
        note="Predicted by the posterior of the model class, with what its parameters leave open. "
        "sd: standard deviation of the measurement. Off: predicted over measured, less one, with "
        "the interval of both; where the sd is not known, with that of the prediction."
        + (_IRREGULAR if _irregular(data) else ""),
        may_break=True,
    )  # fmt: skip


def _irregular(data: HangerReport) -> list[Mode]:
    """Return irregular modes of the latest test that the posterior does not follow."""
    predicted = {(mode.plane, mode.order) for mode in data.predicted}
    return [m for m in data.latest.modes if m.irregular and (m.plane, m.order) not in predicted]


def _irregular_row(mode: Mode) -> tuple[str, ...]:
    measured = f"{mode.frequency_hz:.3f}", formatting.number(mode.frequency_sd_hz, ".4f")
    return (mode.plane, str(mode.order), *measured, "not followed", "", "")


def _frequency_row(
    predicted: PredictedFrequency, measured: Mode | None, off: Interval | None
) -> tuple[str, ...]:
    interval = Interval.normal(predicted.mean_hz, predicted.sd_hz)
    sd = measured.frequency_sd_hz if measured else math.nan
    return (
        predicted.plane,
        str(predicted.order),
        formatting.number(predicted.measured_hz, ".3f", "not measured"),
        formatting.number(sd, ".4f"),
        f"{interval.mean:.3f}",
        f"{interval.low:.3f} to {interval.high:.3f}",
        formatting.with_span(off, signed=True) if off else "not measured",
    )


def quality(data: HangerReport) -> Table:
    return quality_table(data.quality, "Quality of the latest test")


def doubts(data: HangerReport) -> Table:
    """Return the checks that are not good, and how many are."""
    found = [check for check in data.quality if check.verdict in ("warning", "refused")]
    rest = len(data.quality) - len(found)
    made = quality_table(found, "Quality of the latest test: what to improve")
    return replace(made, note=f"{formatting.counted(rest, 'further check')} without a warning.")


def parameters(data: HangerReport) -> Table:
    return shared_tables.parameters(data.posterior)


def models(data: HangerReport) -> Table:
    return shared_tables.model_classes(data.selection)


def practice(data: HangerReport) -> Table:
    """Return formulas of practice from the latest measured frequencies, and our value."""
    title = "Formulas of practice"
    hanger, unit = data.hanger, data.tension_unit
    bar = (hanger.length_m, hanger.mass_per_length_kg_m, hanger.bending_stiffness_n_m2)
    measured = {(mode.plane, mode.order): mode.frequency_hz for mode in data.latest.modes}
    if data.posterior.model == WITHOUT_MODEL or not np.isfinite(bar).all():
        return Table(title, (), ())
    rows: list[tuple[str, ...]] = []

    def add(name: str, found: Sequence[float], *rest: str) -> None:
        if np.isfinite(found).any():
            wording = [
                "unknown" if math.isnan(n) else "below 0" if n < 0 else f"{unit.of(n):.0f}"
                for n in found
            ]
            rows.append((name, *wording, *rest))

    for each in FORMULAS:
        found = [each.tension_n(measured.get((p, each.order), np.nan), *bar) for p in PLANES]
        holds = f"{each.valid_from_xi:g}", _error_cell(each.worst_error)
        add(f"{each.name}, mode {each.order}", found, each.ends, *holds, each.leaves_out)
    by_order = [{n: hz for (this, n), hz in measured.items() if this == plane} for plane in PLANES]
    fitted = [equal_springs.tension_n(this, *bar) for this in by_order]
    add(
        f"{equal_springs.NAME}, all modes",
        fitted,
        equal_springs.ENDS,
        "",
        "",
        equal_springs.LEAVES_OUT,
    )
    if not rows:
        return Table(title, (), ())
    ours = stated(data.by_latest_test, unit)
    both = (ours.tension.removesuffix(f" {unit.name}"),) * 2
    rows.append(("ours, by all modes of the same test", *both, "as inferred", "", "", ""))
    planes = (f"{plane} ({unit.name})" for plane in PLANES)
    heads = ("formula", *planes, "ends", "from xi", "error", "leaves out")
    xi = hanger.slenderness(data.averaged.tension_n.mean)
    note = (
        "Each from the modes that it names, of one plane. "
        f"xi = L sqrt(T/EI) is some {xi:.2g} here: below its range a formula says nothing; error: "
        "the worst within it, on such ends. "
        f"The 90 % interval of ours is {ours.interval}."
    )
    return Table(title, heads, tuple(rows), note)


def _error_cell(fraction: float) -> str:
    return f"{100 * fraction:g} %" if fraction >= _EXACT else "exact"


def history(data: HangerReport) -> Table:
    within = f" in the period {data.period}" if data.period else ""
    unit = force_unit(*(row.tension_n.mean for row in data.trend))
    return Table(
        f"Tests{within}, latest first",
        ("time", "test", "temperature", "model", *formatting.tension_headings(unit)),
        tuple(_history_row(row, unit) for row in reversed(data.trend)),
        note="Tension averaged over the model classes; model: the class selected.",
        hidden_note=_EARLIER,
    ).shortened(_ROWS_SHOWN)


def _history_row(row: TrendRow, unit: ForceUnit) -> tuple[str, ...]:
    tension = row.tension_n.in_unit(unit)
    return (
        formatting.moment(row.time),
        row.test,
        formatting.number(row.temperature_c, ".1f", "not recorded")
        + (" °C" if math.isfinite(row.temperature_c) else ""),
        formatting.model_class(row.model),
        formatting.mean(tension),
        formatting.span(tension),
    )


def alerts(data: HangerReport) -> Table:
    within = f" in the period {data.period}" if data.period else ""
    return Table(
        f"Alerts{within}, latest first",
        ("time", "test", "message", "acknowledged"),
        tuple(_alert_row(row, data.acknowledged) for row in reversed(data.alerts)),
        hidden_note=_EARLIER,
    ).shortened(_ROWS_SHOWN)


def latest_alerts(data: HangerReport) -> Table:
    """Return the latest alerts, each with what it says first."""
    made = alerts(data)
    rows = tuple(
        (time, test, Lead.of(message).words, state)
        for time, test, message, state in made.rows[:_ALERTS_SHOWN]
    )
    more = len(made.rows) - len(rows)
    note = f"{formatting.counted(more, 'earlier one')} in the HTML report." if more else ""
    return Table(made.title, made.headings, rows, note)


def _alert_row(row: Alert, acknowledged: Mapping[str, str]) -> tuple[str, ...]:
    return (formatting.moment(row.time), row.test, row.message, acknowledged.get(row.key, "open"))


def inspections(data: HangerReport) -> Table:
    return Table(
        "Notes and inspections, latest first",
        ("date", "kind", "of", "by", "text"),
        tuple(
            (f"{each.at:%Y-%m-%d}", each.kind, each.of, each.who, each.text)
            for each in data.inspections
        ),
        hidden_note=_EARLIER,
    ).shortened(_ROWS_SHOWN)


def conditions(data: HangerReport) -> Table:
    """Return how the latest test was made, and by what its files are known."""
    test = data.latest
    facts = {
        "test": f"{test.id}, {formatting.moment(test.time)}",
        **shared_tables.conditions(test),
        "modes identified": f"{len(test.modes)}",
        "bar measured by": data.bar.measured_by or NOT_STATED,
        **lineage({key: value for key, value in data.lineage.items() if key not in _COMPUTING}),
        "report made": f"{formatting.moment(data.generated_at)} by shm version {data.version}",
    }
    return Table(
        "Where these numbers come from", ("what", "value"), tuple(facts.items()), is_folded=True
    )


_COMPUTING = frozenset({"input_sha256", "settings_sha256", "software"})
"""What of the lineage only a repetition needs."""


def sampling(data: HangerReport) -> Table:
    """Return how the posterior was computed."""
    posterior = data.posterior
    facts = {
        "model class": formatting.model_class(posterior.model),
        "tests in this posterior": ", ".join(posterior.tests),
        "posterior samples": f"{len(posterior.samples)} (effective "
        f"{formatting.number(posterior.effective_sample_size, '.0f')})",
        "R-hat (1 is converged)": formatting.number(posterior.r_hat, ".3f"),
        "model evaluations": f"{posterior.evaluations}",
        "random seed": f"{posterior.seed}",
        "computing time": _seconds(posterior.seconds),
        **lineage({key: value for key, value in data.lineage.items() if key in _COMPUTING}),
    }
    return Table("How the posterior was computed", ("what", "value"), tuple(facts.items()))


def _seconds(seconds: float) -> str:
    return f"{seconds:.1f} s" if math.isfinite(seconds) else "not known"


_WIDE_K = 10.0


_FEWEST = 3
"""Of two tests at two temperatures nobody can tell an effect of the temperature from a change."""


def temperature_table(states: StatesOverTime) -> Table:
    """Return each quantity's change per kelvin in percent of itself, or why it is not known."""
    why = _why_not_known(states)
    titles = {quantity.name: quantity.title for quantity in states.quantities}
    known = [_is_known(each, states) for each in states.temperature_coefficients]
    rows = tuple(
        _coefficient_row(
            each, titles.get(each.quantity, formatting.quantity(each.quantity)), "" if sure else why
        )
        for each, sure in zip(states.temperature_coefficients, known, strict=True)
    )
    if len(rows) > 1 and not any(known):
        rows = (("tension and end stiffness", f"not known: {why}", ""),)
    return Table(
        "Change with the temperature",
        ("quantity", "change per K", "90 % interval"),
        rows,
        note="In percent of the quantity, mean and standard deviation, beside what the softening "
        "of steel explains (0.03 % of its modulus per K). States over time are free of it; "
        "for the shifts the watch learns a coefficient of its own.",
    )


def temperature_documents(states: StatesOverTime) -> list[dict[str, Any]]:
    """Return the change of each quantity per kelvin; `known` is false without any test."""
    return [
        {
            "quantity": each.quantity,
            "unit": f"{kind_of(each.quantity).shift_unit} per K",
            "mean": each.mean,
            "sd": each.sd,
            "prior_sd": each.prior_sd,
            "known": _is_known(each, states),
            "why_not_known": "" if _is_known(each, states) else _why_not_known(states),
        }
        for each in states.temperature_coefficients
    ]


def _coefficient_row(
    each: TemperatureCoefficient, title: str, why_not_known: str
) -> tuple[str, ...]:
    if why_not_known:
        return (title, f"not known: {why_not_known}", "")
    scale = kind_of(each.quantity).percent_a_unit
    change = Interval.normal(each.mean, each.sd).scaled(scale)
    sd = f"{scale * each.sd:.{formatting.decimals(change.width)}f}"
    return (
        title,
        f"{formatting.mean(change, True)} ± {sd} % per K",
        f"{formatting.span(change, True)} % per K",
    )


def _is_known(each: TemperatureCoefficient, states: StatesOverTime) -> bool:
    """Return True if the tests show it, and are enough to distinguish it from a change."""
    return each.is_known and len(_known_c(states)) >= _FEWEST


def _known_c(states: StatesOverTime) -> FloatArray:
    """Return the temperatures (n,) of the tests that count."""
    return states.temperatures_c[np.isfinite(states.temperatures_c) & ~states.outlier]


def _why_not_known(states: StatesOverTime) -> str:
    known = _known_c(states)
    if len(known) < 2:
        return f"{formatting.counted(len(known), 'test')} with a temperature"
    span_k = float(np.ptp(known))
    if span_k >= _WIDE_K:
        return f"{len(known)} tests over {span_k:.0f} K are too few to tell it from other changes"
    return f"the temperatures of the tests differ by {span_k:.1f} K only"


def control_table(chart: ControlChart) -> Table:
    """Return each test with its limits, the latest first."""
    unit = force_unit(chart.hanger.known_tension_n)
    rows = tuple(
        (
            each.test, formatting.moment(each.time),
            formatting.rounded_tension(each.tension_n, unit),
            formatting.rounded_tension(each.known_n, unit), percent(each.deviation), limits(each),
            "out of limits" if each.is_out else "within limits",
        )
        for each in reversed(chart.points)
    )  # fmt: skip
    names = ("test", "time", "tension", "known", "deviation", "limits", "")
    return Table("Control chart", names, rows, note="Limits: three standard deviations.")
