"""The interactive figures of a test page in reading order: those of the report, drawn by plotly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from shm.report.contents import ModalTestReport
from shm.report.figures.illustration import Member
from shm.report.figures.modal_test_hits import FIGURE as HITS
from shm.report.figures.modal_test_response import FIGURE as RESPONSE
from shm.report.figures.modal_test_shapes import FIGURE as SHAPES
from shm.report.figures.modal_test_shapes import rows_of
from shm.report.figures.modal_test_spectra import Shown
from shm.report.figures.modal_test_stabilisation import DAMPING
from shm.report.figures.modal_test_stabilisation import FIGURE as STABILISATION
from shm.report.figures.modal_test_time_history import FIGURE as TIME_HISTORY
from shm.report.figures.specification import Specification
from shm_daemon.web import with_plotly

_ROW_PX, _REST_PX = 118, 90
"""Of the mode shapes: a row of panels, and what is above and below them."""


@dataclass(frozen=True)
class TestFigure:
    """A figure of the report as the page shows it.

    `source` says what it needs: what the store holds; the raw file, identified once more; or
    `both`, where the store has enough to begin with and the raw file adds to it. `is_wide`: a phone
    shows it by and by, not narrower.
    """

    __test__ = False  # told to pytest

    member: Member[Shown]
    source: Literal["store", "both", "file"]
    height_px: Callable[[ModalTestReport], int]
    is_wide: bool = False

    @property
    def name(self) -> str:
        return self.member.name

    @property
    def title(self) -> str:
        return self.member.title

    def document(self, shown: Shown) -> dict[str, Any] | None:
        """The plotly document with its words; None where there is nothing to show."""
        found = self.member.draw(shown)
        if not isinstance(found, Specification):
            return None
        words = {"caption": self.member.caption(shown), "alt": self.member.alt(shown)}
        return {**with_plotly.document(found), **words}


# Judgement: a figure of one panel fits a laptop's screen with its caption, one of several fills it.
MEMBERS: tuple[TestFigure, ...] = (
    TestFigure(RESPONSE, "both", lambda sheet: 620),
    TestFigure(TIME_HISTORY, "file", lambda sheet: 680),
    TestFigure(HITS, "file", lambda sheet: 760),
    TestFigure(STABILISATION, "file", lambda sheet: 520),
    TestFigure(
        SHAPES,
        "store",
        lambda sheet: _REST_PX + _ROW_PX * len(rows_of(sheet, is_on_screen=True)),
        is_wide=True,
    ),
    TestFigure(DAMPING, "store", lambda sheet: 440),
)
FIGURES = {figure.name: figure for figure in MEMBERS}
FROM_RECORDS = tuple(figure for figure in MEMBERS if figure.source == "file")
