"""The report of a hanger, on paper."""

from __future__ import annotations

from shm.report import words
from shm.report.content import HangerReport
from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.figures import diagnosis_figures
from shm.report.diagnosis.page import in_words
from shm.report.diagnosis.part import diagnosed, how_to_diagnose
from shm.report.facts import facts
from shm.report.figures import illustrations
from shm.report.paper.content import Paper, Part
from shm.report.summary import status, summary
from shm.report.tables import numbers, origins

CLOSING = "Intervals are central 90 % credible intervals; times are UTC."


def hanger_paper(data: HangerReport) -> Paper:
    """Summary, figures, numbers, gap diagnosis, origin."""
    within = f", {data.period}" if data.period else ""
    state = status(data)
    return Paper(
        title=words.hanger_name(data.hanger.id, data.hanger.name) + within,
        bridge=data.bridge,
        status=state.value,
        style=state.name.lower(),
        parts=(
            Part("In short", summary(data), facts(data)),
            Part("Figures", illustrations=illustrations(data)),
            Part("Numbers", tables=numbers(data)),
            _gap(data),
            Part("Origin", tables=origins(data)),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing=CLOSING,
    )


def _gap(data: HangerReport) -> Part:
    sheet = diagnosed(data)
    if sheet is None:
        return Part("Gap diagnosis", " ".join((data.gap_watch, how_to_diagnose(data))).strip())
    return _diagnosis(sheet, data.gap_watch)


def _diagnosis(sheet: DiagnosisSheet, gap_watch: str) -> Part:
    told = in_words(sheet)
    return Part(
        f"Gap diagnosis: {told['answer']}",
        " ".join((gap_watch, told["verdict"], told["consequences"])).strip(),
        told["facts"],
        told["remarks"],
        diagnosis_figures(sheet),
        (*told["answers"], *told["evidence"]),
        told["style"],
    )
