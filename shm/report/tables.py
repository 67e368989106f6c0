"""The tables of a report, as headings and rows of texts: one source for terminal and HTML."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from shm.report import words
from shm.report.bridge.tables import shift_table
from shm.report.content import HangerReport, Interval, TrendRow
from shm.report.quality import quality_table
from shm.report.shifts import shift_cells
from shm.report.summary import tension_change
from shm.report.table import Table
from shm.report.temperatures import temperature_table
from shm.values import Alert, Mode, Posterior, PredictedFrequency


def tables(data: HangerReport) -> tuple[Table, ...]:
    """All tables that this report can fill, in reading order."""
    return tuple(table for table in (make(data) for make in _TABLES) if table.rows)


def tension(data: HangerReport) -> Table:
    nominal_n = data.hanger.nominal_tension_n
    rows = [_tension_row("now", data.tension_n, nominal_n)]
    if data.baseline_tension_n is not None:
        rows.append(_tension_row("baseline", data.baseline_tension_n, nominal_n))
    if (fraction := tension_change(data)) is not None:
        change = fraction.scaled(100)
        rows.append(
            ("change since baseline, %", words.mean(change, True), words.span(change, True), "")
        )
    rows.append(("nominal (as designed)", f"{nominal_n / 1e3:.1f}", "given, no interval", "100.0"))
    return Table(
        "Tension", ("tension", "mean, kN", "90 % interval, kN", "% of nominal"), tuple(rows)
    )


def _tension_row(label: str, tension_n: Interval, nominal_n: float) -> tuple[str, ...]:
    kilonewtons = words.kilonewtons(tension_n)
    share = 100 * tension_n.mean / nominal_n
    return (label, words.mean(kilonewtons), words.span(kilonewtons), f"{share:.1f}")


def drift(data: HangerReport) -> Table:
    return Table(
        "Shift since the baseline",
        ("quantity", "shift", "90 % interval", "threshold", "probability beyond it"),
        tuple(shift_cells(row) for row in data.drifts),
        note="If there is a shift at all: tension in percent, stiffness as how many times what it "
        f"was, the swing with the temperature taken out. {data.drift_watch}".strip(),
    )


def temperatures(data: HangerReport) -> Table:
    return temperature_table(data.states)


_BESIDE = 2


def neighbours(data: HangerReport) -> Table:
    """The hanger and two to either side; empty where nothing is called."""
    title, pattern = "The hangers beside it", data.neighbours
    rows = pattern.rows if pattern else ()
    place = next((row.place for row in rows if row.hanger == data.hanger.id), None)
    if pattern is None or place is None:
        return Table(title, (), ())
    near = tuple(row for row in rows if abs(row.place - place) <= _BESIDE)
    made = shift_table(replace(pattern, rows=near, not_compared=()))
    told = " ".join((pattern.sentence, *pattern.remarks))
    return replace(made, title=title, note=f"{told} The whole bridge: shm report --bridge.")


def frequencies(data: HangerReport) -> Table:
    measured = {(mode.plane, mode.order): mode for mode in data.latest.modes}
    return Table(
        "Frequencies",
        ("plane", "mode", "measured, Hz", "sd, Hz", "predicted, Hz", "90 % interval, Hz", "off, %"),
        tuple(
            _frequency_row(mode, measured.get((mode.plane, mode.order))) for mode in data.predicted
        ),
        note="Predicted by the posterior of the model class; off: predicted over measured.",
    )


def _frequency_row(predicted: PredictedFrequency, measured: Mode | None) -> tuple[str, ...]:
    interval = Interval.normal(predicted.mean_hz, predicted.sd_hz)
    off = 100 * (predicted.mean_hz / predicted.measured_hz - 1)
    sd = measured.frequency_sd_hz if measured else math.nan
    return (
        predicted.plane,
        str(predicted.order),
        words.number(predicted.measured_hz, ".3f", "not measured"),
        words.number(sd, ".4f"),
        f"{interval.mean:.3f}",
        f"{interval.low:.3f} to {interval.high:.3f}",
        words.number(off, "+.2f", "not measured"),
    )


def quality(data: HangerReport) -> Table:
    return quality_table(data.quality, "Quality of the latest test")


def parameters(data: HangerReport) -> Table:
    posterior = data.posterior
    return Table(
        f"Parameters of the model class {words.model_class(posterior.model)}",
        ("name", "meaning", "mean", "90 % interval", "most probable"),
        tuple(_parameter_row(posterior, name) for name in posterior.names),
    )


def _parameter_row(posterior: Posterior, name: str) -> tuple[str, ...]:
    interval = Interval.of_samples(posterior.parameter(name))
    best = posterior.most_probable[posterior.names.index(name)]
    return (
        name,
        words.meaning(name, posterior.model),
        words.mean(interval),
        words.span(interval),
        f"{best:.{words.decimals(interval.width)}f}",
    )


def models(data: HangerReport) -> Table:
    pairs = (
        zip(data.selection.posteriors, data.selection.probabilities, strict=True)
        if data.selection
        else ()
    )
    return Table(
        "Model classes",
        ("model", "probability", "log evidence", "sd", "tension, kN", "90 % interval, kN"),
        tuple(_model_row(posterior, share) for posterior, share in pairs),
    )


def _model_row(posterior: Posterior, share: float) -> tuple[str, ...]:
    kilonewtons = words.kilonewtons(Interval.of_samples(posterior.tension_n))
    return (
        words.model_class(posterior.model),
        words.probability(share),
        f"{posterior.log_evidence:.2f}",
        words.number(posterior.log_evidence_sd, ".2f"),
        words.mean(kilonewtons),
        words.span(kilonewtons),
    )


def history(data: HangerReport) -> Table:
    return Table(
        "Tests, latest first",
        ("time", "test", "temperature", "model", "tension, kN", "90 % interval, kN"),
        tuple(_history_row(row) for row in reversed(data.trend)),
    )


def _history_row(row: TrendRow) -> tuple[str, ...]:
    kilonewtons = words.kilonewtons(row.tension_n)
    return (
        words.moment(row.time),
        row.test,
        words.number(row.temperature_c, ".1f", "not recorded")
        + (" °C" if math.isfinite(row.temperature_c) else ""),
        words.model_class(row.model),
        words.mean(kilonewtons),
        words.span(kilonewtons),
    )


def alerts(data: HangerReport) -> Table:
    return Table(
        "Alerts, latest first",
        ("time", "test", "message", "acknowledged"),
        tuple(_alert_row(row, data.acknowledged) for row in reversed(data.alerts)),
    )


def _alert_row(row: Alert, acknowledged: Mapping[str, str]) -> tuple[str, ...]:
    return (words.moment(row.time), row.test, row.message, acknowledged.get(row.key, "open"))


def origin(data: HangerReport) -> Table:
    posterior, test = data.posterior, data.latest
    amplitude = f"{words.number(test.amplitude, '.3g', 'not recorded')}"
    facts = {
        "test": f"{test.id}, {words.moment(test.time)}",
        "temperature": words.temperature(test.temperature_c),
        "hit level over reference level": amplitude,
        "added mass": _added_mass(data),
        "modes identified": f"{len(test.modes)}",
        "tests in this posterior": ", ".join(posterior.tests),
        "posterior samples": f"{len(posterior.samples)} (effective "
        f"{words.number(posterior.effective_sample_size, '.0f')})",
        "R-hat (1 is settled)": words.number(posterior.r_hat, ".3f"),
        "model evaluations": f"{posterior.evaluations}",
        "random seed": f"{posterior.seed}",
        "computing time": f"{words.number(posterior.seconds, '.1f')} s",
        **data.lineage,
        "shm version": data.version,
        "report made": words.moment(data.generated_at),
    }
    return Table("Where these numbers come from", ("what", "value"), tuple(facts.items()))


def _added_mass(data: HangerReport) -> str:
    mass = data.latest.added_mass
    return f"{mass.mass_kg:g} kg at {mass.x_m:g} m from the deck end" if mass else "none"


_TABLES: tuple[Callable[[HangerReport], Table], ...] = (
    tension,
    drift,
    alerts,
    neighbours,
    temperatures,
    frequencies,
    quality,
    models,
    parameters,
    history,
    origin,
)
