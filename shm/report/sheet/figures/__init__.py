"""The figures of one hammer test. A new one: a file with a `FIGURE`, and a line in `MEMBERS`."""

from __future__ import annotations

from shm.report.contents import TestSheet
from shm.report.figures.member import Illustration, Member, drawn
from shm.report.sheet.figures.damping import FIGURE as DAMPING
from shm.report.sheet.figures.hits import FIGURE as HITS
from shm.report.sheet.figures.quality import FIGURE as QUALITY
from shm.report.sheet.figures.response import FIGURE as RESPONSE
from shm.report.sheet.figures.shapes import FIGURE as SHAPES
from shm.report.sheet.figures.stabilisation import FIGURE as STABILISATION
from shm.report.sheet.figures.time_history import FIGURE as TIME_HISTORY
from shm.report.sheet.spectra import Shown

MEMBERS: tuple[Member[Shown], ...] = (
    QUALITY,
    TIME_HISTORY,
    HITS,
    RESPONSE,
    STABILISATION,
    SHAPES,
    DAMPING,
)
# The quality stands there as a table of words, which can be searched and read aloud.
_PAGE_MEMBERS = tuple(member for member in MEMBERS if member is not QUALITY)


def test_figures(sheet: TestSheet) -> tuple[Illustration, ...]:
    """Every figure of one hammer test that its records and modes allow, in reading order."""
    return drawn(MEMBERS, Shown.of(sheet))


def page_figures(sheet: TestSheet) -> tuple[Illustration, ...]:
    """Those of them that are no table."""
    return drawn(_PAGE_MEMBERS, Shown.of(sheet))
