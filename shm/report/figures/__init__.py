"""The figures of a hanger's report. A new one: a file with a `FIGURE`, and a line in `MEMBERS`."""

from __future__ import annotations

from shm.report.contents import HangerReport
from shm.report.figures.drift import FIGURE as DRIFT
from shm.report.figures.frequencies import FIGURE as FREQUENCIES
from shm.report.figures.member import Illustration, Member, drawn
from shm.report.figures.response import FIGURE as RESPONSE
from shm.report.figures.stiffness import FIGURE as STIFFNESS
from shm.report.figures.tension import FIGURE as TENSION
from shm.report.figures.trend import FIGURE as TREND

__all__ = ["MEMBERS", "Illustration", "illustrations"]

MEMBERS: tuple[Member[HangerReport], ...] = (
    TREND,
    DRIFT,
    TENSION,
    FREQUENCIES,
    RESPONSE,
    STIFFNESS,
)


def illustrations(data: HangerReport) -> tuple[Illustration, ...]:
    """Every figure that this report has the data for, in reading order."""
    return drawn(MEMBERS, data)
