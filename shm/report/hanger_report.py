"""The report of one hanger, or of a structure without a model: what an engineer files about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any

from shm import documents, modes_document
from shm.documents import alert_document
from shm.report import formatting
from shm.report import hanger_tables as tables
from shm.report.assumed import assumptions_line, assumptions_table, with_assumptions
from shm.report.bar_table import bar_document, bar_table
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.control_report import chart_document
from shm.report.diagnosis_report import causes, diagnosis_json, diagnosis_part
from shm.report.figures.bar_sketch import FIGURE as SKETCH
from shm.report.figures.control_chart import FIGURE as CONTROL
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_temperature import FIGURE as TEMPERATURE
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.specification import drawn
from shm.report.formatting import Interval
from shm.report.hanger_sentences import advice, fit, over_time, summary, why
from shm.report.hanger_status import UNDETERMINED
from shm.report.hanger_summary import BASELINE_ALONE, BASELINE_AND_CHANGE
from shm.report.hanger_tables import control_table, temperature_documents
from shm.report.open_warnings import dated_by_receipt
from shm.report.paper import CREDIBLE, Fact, Paper, Section, Table, appendices, filled
from shm.report.shared_tables import settings
from shm.report.shifts import pattern_json
from shm.report.states import period_json
from shm.values import Alert, ControlHanger, Drift, FrequencyResponse, Hanger
from shm.values.rounding import NINETY_PERCENT, force_unit, rounded_percent
from shm.values.stated_tension import StatedTension, stated
from shm.watch.words.alert_text import structure_words


def hanger_paper(data: HangerReport, *, is_brief: bool = False) -> Paper:
    """Return page 1 with all that is acted on; then why; appendices are for a screen.

    One that `is_brief` has its first part alone.
    """
    first = Section(
        "In short",
        lead=data.now.message.words,
        summary=why(data),
        facts=facts(data),
        tables=[bar_table(data.bar)],
    )
    return Paper(
        title=formatting.hanger_name(data.hanger.id, data.hanger.name),
        bridge=data.bridge,
        period=str(data.period) if data.period else "",
        status=data.status.value,
        style=data.status.name.lower(),
        parts=(first,) if is_brief else (first, *_parts(data)),
        is_signed=True,
        letterhead=data.letterhead,
        generated_at=data.generated_at,
        version=data.version,
        closing=f"{CREDIBLE}; times are UTC.",
        more=f"All of it: `shm report --hanger {data.hanger.id} --full`, or "
        f"`--out hanger{data.hanger.id}.pdf`.",
    )


def _parts(data: HangerReport) -> tuple[Section, ...]:
    """Return what follows page 1."""
    return (
        Section(
            "Sensors and formulas of practice",
            figures=lambda: drawn((SKETCH,), data.bar),
            tables=filled(tables.practice(data)),
        ),
        _trend_part(data),
        Section(
            "Fit of the model",
            paragraphs=[fit(data)],
            figures=lambda: drawn((FREQUENCIES,), data),
            tables=[tables.frequencies(data)],
        ),
        short_gap_part(data),
        _events_part(data),
        *_appendices(data),
    )


def _trend_part(data: HangerReport) -> Section:
    """Return the tension over time; of a control hanger its control chart first."""
    chart = data.now.control
    return Section(
        "Tension over time",
        paragraphs=[words] if (words := over_time(data)) else (),
        figures=lambda: (*drawn((CONTROL,), chart), *drawn((TREND,), data)),
        tables=filled(
            *([control_table(chart)] if chart else []),
            tables.changes(data),
            tables.neighbours(data),
        ),
    )


def _events_part(data: HangerReport) -> Section:
    """Return what was doubted, reported, noted and measured with."""
    return Section(
        "Test, alerts and notes",
        paragraphs=[assumptions_line(data.hanger)],
        tables=filled(
            tables.doubts(data),
            tables.latest_alerts(data),
            tables.inspections(data),
            tables.conditions(data),
        ),
    )


def _appendices(data: HangerReport) -> tuple[Section, ...]:
    """Return what only the page and `--full` show: figures, numbers, the gap, settings."""
    return appendices(
        Section(
            "Numbers",
            tables=filled(
                tables.parameters(data),
                tables.models(data),
                tables.temperatures(data),
                tables.quality(data),
                tables.history(data),
                tables.alerts(data),
            ),
        ),
        *([gap_part(data)] if data.diagnosis else []),
        Section(
            "Settings",
            tables=filled(
                tables.sampling(data),
                settings(data.settings),
                assumptions_table(data.hanger),
            ),
        ),
        Section("Figures", figures=lambda: drawn((STIFFNESS, TEMPERATURE), data)),  # text has none
    )


def gap_part(data: HangerReport) -> Section:
    """Return how the gap has gone since an effect was adopted, then its latest diagnosis."""
    watched = [data.gap_watch] if data.gap_watch else []
    if sheet := diagnosed(data):
        return diagnosis_part(sheet, "Gap diagnosis", watched)
    return Section("Gap diagnosis", paragraphs=[*watched, how_to_diagnose(data)])


def short_gap_part(data: HangerReport) -> Section:
    """Return the same as a page of a report bears it: verdict, figures on top, causes."""
    part = gap_part(data)
    if (sheet := diagnosed(data)) is None:
        return part
    return replace(part, details="", remarks=(), figures=tuple, tables=(causes(sheet),))


def diagnosed(data: HangerReport) -> DiagnosisSheet | None:
    """Return the latest diagnosis of the report's hanger."""
    if data.diagnosis is None:
        return None
    return DiagnosisSheet(data.diagnosis, data.hanger, data.bridge, data.bar.sensors)


def how_to_diagnose(data: HangerReport) -> str:
    """Return what to do where no diagnosis was made."""
    return (
        "The gap between model and measurement has not been diagnosed. To learn where it lies, "
        "what causes it and what that does to the tension: "
        f"shm gap diagnose --hanger {data.hanger.id}"
    )


def facts(data: HangerReport) -> tuple[Fact, ...]:
    """Return what, value, and what belongs to it."""
    return (
        _tension(data),
        *_limits(data, stated(data.averaged, data.tension_unit)),
        _against_known(data.hanger) or _since_baseline(data),
        _of_nominal(data),
        *_by_latest_test(data),
        *_at_level(data),
        _latest_test(data),
    )


def _latest_test(data: HangerReport) -> Fact:
    time, temperature = data.latest.time, formatting.temperature(data.latest.temperature_c)
    if time is None:
        return ("Latest test", "time not recorded", temperature)
    return ("Latest test", f"{time:%Y-%m-%d}", f"{formatting.moment(time)[11:]}; {temperature}")


def _tension(data: HangerReport) -> Fact:
    words = stated(data.averaged, data.tension_unit)
    doubt = "" if data.averaged.is_usable else "do not use it; "
    if not data.now.is_determined:
        interval = f"{UNDETERMINED}; {doubt}90 % interval {words.interval}"
        return ("Tension", "not determined", interval)
    value = formatting.with_half(data.tension_n, data.tension_unit)
    return ("Tension", value, f"{doubt}90 % interval; from {data.now.basis}")


def _by_latest_test(data: HangerReport) -> tuple[Fact, ...]:
    if data.now.basis not in (BASELINE_AND_CHANGE, BASELINE_ALONE):
        return ()
    alone = Interval.of_averaged(data.by_latest_test)
    value = formatting.with_half(alone, data.tension_unit)
    repeats = stated(data.by_latest_test, data.tension_unit).repeatability
    scatter = f"; repeatability {repeats} (sd)" if repeats else ""
    doubt = "" if data.by_latest_test.is_usable else "do not use it; "
    caveats = "".join(f". {each.rstrip('.')}" for each in data.now.caveats_of_latest)
    note = f"{doubt}test {data.latest.id}; 90 % interval{scatter}{caveats}"
    return (("Latest test alone", value, note),)


def _at_level(data: HangerReport) -> tuple[Fact, ...]:
    """Return the tension at the reference level; nothing where none is set."""
    if (known := data.at_level) is None:
        return ()
    what = f"At hits of {known.force_n:.4g} N"
    if known.tension_n is None:
        return ((what, "not known", known.reason),)
    value = formatting.with_half(known.tension_n, data.tension_unit)
    return ((what, value, f"90 % interval; test {data.latest.id} at level {known.level:g}"),)


def _limits(data: HangerReport, statement: StatedTension) -> tuple[Fact, ...]:
    """Return the probabilities that the owner's limits ask for."""
    limits, unit = data.hanger.limits, data.tension_unit
    asked = (
        ("Above its limit", statement.above, limits.tension_max_n),
        ("Slack", statement.slack, limits.tension_min_n),
    )
    return tuple(
        (what, probability, f"probability; limit {formatting.rounded_tension(limit_n, unit)}")
        for what, probability, limit_n in asked
        if probability
    )


def _of_nominal(data: HangerReport) -> Fact:
    share = data.now.of_nominal
    if share is None:
        return ("Of nominal", "not known", "the hanger has no nominal tension")
    if not data.now.is_determined:
        return (
            "Of nominal",
            data.now.of_nominal_words,
            f"90 % interval {formatting.span(share)} %",
        )
    nominal = formatting.rounded_tension(data.hanger.nominal_tension_n, data.tension_unit)
    return ("Of nominal", data.now.of_nominal_words, f"90 % interval; nominal {nominal}")


def _against_known(hanger: Hanger) -> Fact | None:
    """Return the known tension of a control hanger; None of any other."""
    if not isinstance(hanger, ControlHanger):
        return None
    known = Interval.normal(hanger.known_tension_n, hanger.known_tension_sd_n)
    return ("Known tension", formatting.with_half(known, force_unit(known.mean)), "as described")


def _since_baseline(data: HangerReport) -> Fact:
    change = data.now.change
    if change is None and data.baseline_tension_n is not None:
        return ("Since the baseline", "not known", "the latest test does not show it")
    if change is None:
        return ("Since the baseline", "baseline only", "no later test to compare with")
    size = rounded_percent(change.mean, change.width / 2, "+")
    doubt = "" if data.now.is_found else "; no significant change"
    before_n = data.baseline_tension_n
    origin = f"; from {formatting.with_half(before_n, data.tension_unit)}" if before_n else ""
    return ("Since the baseline", size, f"90 % interval{origin}{doubt}")


REPORT_SCHEMA = "shm.report/1"


def hanger_json(data: HangerReport) -> dict[str, Any]:
    """Return a document for `shm.documents.dump`; unknown numbers become null there."""
    document = {
        "schema": REPORT_SCHEMA,
        "bridge": data.bridge,
        "hanger": asdict(data.hanger),
        "bar": bar_document(data.bar),
        "status": data.status.name.lower(),
        "message": data.now.message.document,
        "summary": summary(data),
        "advice": list(advice(data)),
        "test": modes_document.test_document(data.latest),
        "posterior": documents.posterior_document(data.posterior),
        "baseline": documents.posterior_document(data.baseline) if data.baseline else None,
        "selection": (
            documents.selection_document(data.selection, data.hanger.limits)
            if data.selection
            else None
        ),
        **data.now.numbers,
        "by_latest_test": documents.averaged_document(data.by_latest_test),
        "trend": [asdict(row) for row in data.trend],
        "drifts": [asdict(drift) for drift in data.drifts],
        "alerts": [documents.alert_document(alert) for alert in data.alerts],
        "acknowledged": dict(data.acknowledged),
        "frequency_response": _response(data.frequency_response),
        "quality": [asdict(check) for check in data.quality],
        "diagnosis": diagnosis_json(sheet) if (sheet := diagnosed(data)) else None,
        "gap_watch": data.gap_watch,
        "drift_watch": data.drift_watch,
        "creep_per_year": documents.creep_document(data.creep),
        "inspections": [asdict(note) for note in data.inspections],
        "warnings": list(data.now.warnings),
        "redescribed": list(data.redescribed),
        "discarded_of_baseline": list(data.discarded),
        "dated_by_receipt": list(data.now.undated),
        "temperature_coefficients": temperature_documents(data.states),
        "neighbours": pattern_json(data.neighbours) if data.neighbours else None,
        "period": period_json(data.period),
        "lineage": dict(data.lineage),
        "settings": dict(data.settings),
        "version": data.version,
        "generated_at": data.generated_at,
    }
    if data.now.control is not None:
        document["control"] = chart_document(data.now.control)
    if data.at_level is not None:
        document["at_level"] = asdict(data.at_level)
    return with_assumptions(document, data.hanger)


def _response(response: FrequencyResponse | None) -> dict[str, Any] | None:
    """Return what was measured, without the lines: those are in the archived recording."""
    if response is None:
        return None
    return {
        "source": response.source,
        "points": [asdict(point) for point in response.points],
        "lines": len(response.frequency_hz),
        "highest_frequency_hz": float(response.frequency_hz[-1]),
    }


_NOT_WATCHED = "No test was watched yet: its first tests make the baseline."


@dataclass(frozen=True, eq=False)
class StructureReport:
    """The data that the report of a structure is made of.

    `baseline_hz` are its first frequencies by name, `statement` is the message of the watch after
    its latest test, empty before one was watched; `undated` names the tests dated by their receipt.
    """

    bridge: str
    structure: Hanger
    tests: int
    latest: datetime | None
    baseline_since: datetime | None
    baseline_hz: dict[str, float]
    statement: str
    drifts: tuple[Drift, ...]
    alerts: tuple[Alert, ...]
    open_alerts: int
    generated_at: datetime
    version: str
    undated: tuple[str, ...] = ()


def structure_paper(data: StructureReport) -> Paper:
    """Return the paper: the message of the watch, each frequency, the alerts."""
    latest = f"{data.latest:%Y-%m-%d %H:%M}" if data.latest else "none"
    since = f"{data.baseline_since:%Y-%m-%d}" if data.baseline_since else "none yet"
    facts = (
        ("Tests", str(data.tests), f"the latest {latest}"),
        ("Baseline since", since, "its own first tests; no model, no tension"),
        ("Open alerts", str(data.open_alerts), f"of {len(data.alerts)}"),
    )
    wording = tuple((f"{each.time:%Y-%m-%d}", each.message) for each in data.alerts)
    alerts = Table("Alerts", ("test of", "message"), wording)
    statement = f"{data.statement or _NOT_WATCHED} {dated_by_receipt(data.undated)}".strip()
    return Paper(
        title=structure_words(data.structure),
        bridge=data.bridge,
        status="Alert" if data.open_alerts else "",
        style="alert" if data.open_alerts else "first",
        parts=(
            Section(
                "In short",
                summary=statement,
                facts=facts,
                brief=filled(_structure_frequencies(data)),
            ),
            Section("Numbers", tables=filled(_structure_frequencies(data), alerts)),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing=f"{CREDIBLE}; times are UTC.",
    )


def _structure_frequencies(data: StructureReport) -> Table:
    by_name = {each.quantity: each for each in data.drifts}
    rows = tuple(
        (name, f"{hz:.4g} Hz", *_frequency_shift(by_name.get(name)))
        for name, hz in data.baseline_hz.items()
    )
    return Table(
        "Frequencies",
        ("frequency", "baseline", "shift if it changed", "probability beyond threshold"),
        rows,
        note="Temperature, frost and excitation are taken off.",
    )


def _frequency_shift(drift: Drift | None) -> tuple[str, str]:
    if drift is None:
        return "not watched yet", ""
    shift = rounded_percent(drift.shift_mean, NINETY_PERCENT * drift.shift_sd, "+")
    return shift, f"{drift.probability:.2f} (of {100 * drift.threshold:.3g} %)"


def structure_json(data: StructureReport) -> dict[str, Any]:
    """Return the same as one document."""
    return {
        "bridge": data.bridge,
        "structure": data.structure.id,
        "name": data.structure.name,
        "tests": data.tests,
        "latest_test": data.latest,
        "baseline_since": data.baseline_since,
        "baseline_hz": data.baseline_hz,
        "said": data.statement,
        "drifts": [asdict(each) for each in data.drifts],
        "alerts": [alert_document(each) for each in data.alerts],
        "open_alerts": data.open_alerts,
        "dated_by_receipt": list(data.undated),
        "generated_at": data.generated_at,
        "version": data.version,
    }
