"""What a figure of the hanger page declares about itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from shm.report.figures.specification import Specification
from shm_daemon.web import with_plotly
from shm_daemon.web.hanger_view import HangerView


@dataclass(frozen=True)
class HangerFigure:
    """A figure, and where on the page it stands (`part`).

    `is_there` says whether the hanger has what it shows and costs next to nothing beside the page;
    `draw` gives its specification, `caption` explains what is seen, `alt` says what a blind
    reader needs. What `shows_states` is not whole while the states over time are worked out; what
    `is_wide` scrolls on a phone.
    """

    name: str
    title: str
    part: str
    is_there: Callable[[HangerView], bool]
    draw: Callable[[HangerView], object]
    caption: Callable[[HangerView], str]
    alt: Callable[[HangerView], str]
    height_px: int = 360
    shows_states: bool = False
    is_wide: bool = False

    def document(self, view: HangerView) -> dict[str, Any]:
        """The plotly document with its words."""
        found = self.draw(view)
        assert isinstance(found, Specification)
        words = {"caption": self.caption(view), "alt": self.alt(view)}
        return {**with_plotly.document(found), **words}
