"""The figures of a hanger's page: those of its report, and where on the page each stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from shm.report.figures.control_chart import FIGURE as CONTROL
from shm.report.figures.gap_causes import FIGURE as CAUSES
from shm.report.figures.gap_map import FIGURE as GAP_MAP
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_temperature import FIGURE as TEMPERATURE
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.specification import FigureSpec, Specification
from shm_daemon.web import with_plotly
from shm_daemon.web.hanger_view import HangerView

AT_WORK = "The state over time is being worked out."


@dataclass(frozen=True)
class HangerFigure:
    """A figure, and the `part` of the page where it stands.

    `data` is what it is drawn from, None where the hanger has none. What `shows_states` is not
    complete while the states over time are worked out.
    """

    part: str
    member: FigureSpec[Any]
    data: Callable[[HangerView], Any]
    height_px: int = 360
    shows_states: bool = False

    def specify(self, view: HangerView) -> Specification | None:
        """Return what is drawn; None where the hanger lacks it."""
        data = self.data(view)
        found = None if data is None else self.member.draw(data)
        assert found is None or isinstance(found, Specification)
        return found

    def caption(self, view: HangerView) -> str:
        return self.member.caption(self.data(view))

    def document(self, view: HangerView) -> dict[str, Any] | None:
        """Return the plotly document with its words, and a message while more will come."""
        found = self.specify(view)
        if found is None:
            return None
        alt = self.member.alt(self.data(view))
        document = with_plotly.with_words(found, self.caption(view), alt)
        is_waiting = self.shows_states and view.states is None
        return {**document, "message": AT_WORK} if is_waiting else document


# Judgement: heights in pixels; the usual, or more for several panels and long words.
FIGURES: tuple[HangerFigure, ...] = (
    HangerFigure("trends", CONTROL, lambda view: view.report and view.report.now.control),
    HangerFigure("trends", TREND, lambda view: view.report, 480, shows_states=True),
    HangerFigure("trends", STIFFNESS, lambda view: view.report, 520, shows_states=True),
    HangerFigure("trends", TEMPERATURE, lambda view: view.report),
    HangerFigure("model", FREQUENCIES, lambda view: view.report, 380),
    HangerFigure("gap", CAUSES, lambda view: view.sheet, 560),
    HangerFigure("gap_details", GAP_MAP, lambda view: view.sheet, 480),
)
"""In reading order; a new one is a line here."""
