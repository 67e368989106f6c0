"""The report of one hanger: what an engineer files about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from shm import documents, modes_document
from shm.report import formatting
from shm.report.bridge_report import pattern_json
from shm.report.contents import DiagnosisSheet, HangerReport, message, of_nominal, status
from shm.report.diagnosis_report import diagnosis_json, diagnosis_part
from shm.report.hanger_summary import advice, further, is_found, summary, tension_change, why
from shm.report.hanger_tables import numbers, origins, results
from shm.report.paper import CREDIBLE, Fact, Paper, Part, appendices
from shm.report.shifts import temperature_documents
from shm.report.states import period_json
from shm.values import FrequencyResponse
from shm.values.stated_tension import StatedTension, stated

if TYPE_CHECKING:
    from shm.report.figures.specification import Illustration


def hanger_paper(data: HangerReport) -> Paper:
    """Two pages: state, action, trend, fit, results; all else is an appendix."""
    state = status(data)
    return Paper(
        title=formatting.hanger_name(data.hanger.id, data.hanger.name),
        bridge=data.bridge,
        period=str(data.period) if data.period else "",
        status=state.value,
        style=state.name.lower(),
        parts=(
            Part("In short", lead=message(data).words, summary=why(data), facts=facts(data)),
            Part("Results", figures=lambda: _figures(data, TREND), tables=(results(data),)),
            Part("Fit of the model", figures=lambda: _figures(data, FIT)),
            Part("Details", paragraphs=[further(data)]),
            *appendices(
                Part("Figures", figures=lambda: _further_figures(data)),
                Part("Numbers", tables=numbers(data)),
                gap_part(data),
                Part("Origin", tables=origins(data)),
            ),
        ),
        is_signed=True,
        letterhead=data.letterhead,
        generated_at=data.generated_at,
        version=data.version,
        closing=f"{CREDIBLE}; times are UTC.",
    )


def gap_part(data: HangerReport) -> Part:
    """How the gap has gone since an effect was adopted, then its latest diagnosis, if any."""
    watched = [data.gap_watch] if data.gap_watch else []
    if sheet := diagnosed(data):
        return diagnosis_part(sheet, "Gap diagnosis", watched)
    return Part("Gap diagnosis", paragraphs=[*watched, how_to_diagnose(data)])


TREND, FIT = frozenset({"trend"}), frozenset({"frequencies"})


def _figures(data: HangerReport, names: frozenset[str]) -> Sequence[Illustration]:
    from shm.report.figures.every_figure import hanger_figures

    return hanger_figures(data, names)


def _further_figures(data: HangerReport) -> Sequence[Illustration]:
    """All that do not lead: a new figure is among them by itself."""
    from shm.report.figures.every_figure import OF_HANGER_NAMES, hanger_figures

    return hanger_figures(data, OF_HANGER_NAMES - TREND - FIT)


def diagnosed(data: HangerReport) -> DiagnosisSheet | None:
    """The latest diagnosis of the report's hanger."""
    if data.diagnosis is None:
        return None
    return DiagnosisSheet(data.diagnosis, data.hanger, data.bridge)


def how_to_diagnose(data: HangerReport) -> str:
    """What to do where no diagnosis was made."""
    return (
        "The gap between model and measurement has not been diagnosed. To learn where it lies, "
        "what causes it and what that does to the tension: "
        f"shm gap diagnose --hanger {data.hanger.id}"
    )


def facts(data: HangerReport) -> tuple[Fact, ...]:
    """What, value, what stands beside it."""
    unit = data.tension_unit
    said = stated(data.averaged, unit)
    repeats = f"; repeatability {said.repeatability}" if said.repeatability else ""
    return (
        ("Tension", said.tension, f"90 % interval {said.interval}{repeats}"),
        *_limits(data, said),
        _of_nominal(data),
        _since_baseline(data),
        (
            "Latest test",
            formatting.moment(data.latest.time),
            formatting.temperature(data.latest.temperature_c),
        ),
        (
            "Model class",
            formatting.model_class(data.posterior.model),
            f"{formatting.counted(len(data.latest.modes), 'mode')} identified",
        ),
    )


def _limits(data: HangerReport, said: StatedTension) -> tuple[Fact, ...]:
    """The probabilities that the owner's limits ask for."""
    limits, unit = data.hanger.limits, data.tension_unit
    asked = (
        ("Above its limit", said.above, limits.tension_max_n),
        ("Slack", said.slack, limits.tension_min_n),
    )
    return tuple(
        (what, probability, f"probability; limit {formatting.rounded_tension(limit_n, unit)}")
        for what, probability, limit_n in asked
        if probability
    )


def _of_nominal(data: HangerReport) -> Fact:
    share = of_nominal(data.tension_n, data.hanger)
    if share is None:
        return ("Of nominal", "not known", "the hanger has no nominal tension")
    nominal = formatting.rounded_tension(data.hanger.nominal_tension_n, data.tension_unit)
    return (
        "Of nominal",
        f"{formatting.mean(share)} %",
        f"90 % interval {formatting.span(share)} %; nominal {nominal}",
    )


def _since_baseline(data: HangerReport) -> Fact:
    change = tension_change(data)
    if change is None:
        return ("Since the baseline", "first test", "nothing earlier to compare with")
    percent = change.scaled(100)
    return (
        "Since the baseline",
        f"{formatting.mean(percent, signed=True)} %",
        f"90 % interval {formatting.span(percent, signed=True)} %"
        f"{'' if is_found(data) else ', if it has moved at all'}",
    )


REPORT_SCHEMA = "shm.report/1"


def hanger_json(data: HangerReport) -> dict[str, Any]:
    """A document for `shm.documents.dump`; unknown numbers become null there."""
    return {
        "schema": REPORT_SCHEMA,
        "bridge": data.bridge,
        "hanger": asdict(data.hanger),
        "status": status(data).name.lower(),
        "message": message(data).document,
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
        "averaged": documents.averaged_document(data.averaged),
        "trend": [asdict(row) for row in data.trend],
        "drifts": [documents.drift_document(drift) for drift in data.drifts],
        "alerts": [documents.alert_document(alert) for alert in data.alerts],
        "acknowledged": dict(data.acknowledged),
        "frequency_response": _response(data.frequency_response),
        "quality": [asdict(check) for check in data.quality],
        "diagnosis": diagnosis_json(sheet) if (sheet := diagnosed(data)) else None,
        "gap_watch": data.gap_watch,
        "drift_watch": data.drift_watch,
        "creep_per_year": documents.creep_document(data.creep),
        "inspections": [asdict(note) for note in data.inspections],
        "warnings": list(data.warnings),
        "redescribed": list(data.redescribed),
        "discarded_of_baseline": list(data.discarded),
        "temperature_coefficients": temperature_documents(data.states),
        "neighbours": pattern_json(data.neighbours) if data.neighbours else None,
        "period": period_json(data.period),
        "lineage": dict(data.lineage),
        "settings": dict(data.settings),
        "version": data.version,
        "generated_at": data.generated_at,
    }


def _response(response: FrequencyResponse | None) -> dict[str, Any] | None:
    """What was measured, without the lines: those stand in the archived recording."""
    if response is None:
        return None
    return {
        "source": response.source,
        "points": [asdict(point) for point in response.points],
        "lines": len(response.frequency_hz),
        "highest_frequency_hz": float(response.frequency_hz[-1]),
    }
