"""The report of one hanger: what an engineer files about it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shm.report import words
from shm.report.content import HangerReport, status
from shm.report.diagnosis.part import diagnosed, how_to_diagnose
from shm.report.diagnosis_report import diagnosis_part
from shm.report.facts import facts
from shm.report.paper import CREDIBLE, Paper, Part
from shm.report.summary import summary
from shm.report.tables import numbers, origins

if TYPE_CHECKING:
    from shm.report.figures.member import Illustration


def hanger_paper(data: HangerReport) -> Paper:
    """Summary, figures, numbers, gap diagnosis, origin."""
    state = status(data)
    return Paper(
        title=words.hanger_name(data.hanger.id, data.hanger.name),
        bridge=data.bridge,
        period=str(data.period) if data.period else "",
        status=state.value,
        style=state.name.lower(),
        parts=(
            Part("In short", summary=summary(data), facts=facts(data)),
            Part("Figures", figures=lambda: _figures(data)),
            Part("Numbers", tables=numbers(data)),
            gap_part(data),
            Part("Origin", tables=origins(data)),
        ),
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


def _figures(data: HangerReport) -> Sequence[Illustration]:
    from shm.report.figures import illustrations

    return illustrations(data)
