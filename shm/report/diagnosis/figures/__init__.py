"""The figures of a gap diagnosis. A new one: a file with a `FIGURE`, and a line in `MEMBERS`."""

from __future__ import annotations

from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis.figures.before_and_after import FIGURE as BEFORE_AND_AFTER
from shm.report.diagnosis.figures.causes import FIGURE as CAUSES
from shm.report.diagnosis.figures.gap_map import FIGURE as GAP_MAP
from shm.report.diagnosis.figures.tension import FIGURE as TENSION
from shm.report.figures.member import Illustration, Member, drawn

MEMBERS: tuple[Member[DiagnosisSheet], ...] = (CAUSES, GAP_MAP, BEFORE_AND_AFTER, TENSION)


def diagnosis_figures(sheet: DiagnosisSheet) -> tuple[Illustration, ...]:
    """Every figure of a gap diagnosis that it has the numbers for, in reading order."""
    return drawn(MEMBERS, sheet)
