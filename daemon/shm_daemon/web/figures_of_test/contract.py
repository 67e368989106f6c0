"""What a figure of a test page declares about itself, and what it is drawn from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from shm.report import TestSheet
from shm.report.sheet.spectra import Spectrum, spectrum

Source = Literal["store", "both", "file"]


@dataclass(frozen=True, eq=False)
class Shown:
    """A sheet, the curve its modes are peaks of, and which response of it is asked for.

    `point` is an index into the points of `spectrum`.
    """

    sheet: TestSheet
    spectrum: Spectrum | None
    point: int = 0

    @classmethod
    def of(cls, sheet: TestSheet, point: int = 0) -> Shown:
        """With the curve worked out from the sheet, whose records must be there."""
        return cls(sheet, spectrum(sheet), point)


@dataclass(frozen=True)
class TestFigure:
    """A figure: `draw` gives the plotly document, None where there is nothing to show.

    `source` says what it needs: what the store holds; the raw file, identified once more; or
    `both`, where the store has enough to begin with and the raw file adds to it. `caption` and
    `alt` are asked only of what was drawn. `is_wide`: a phone shows it by and by, not narrower.
    """

    __test__ = False  # told to pytest

    name: str
    title: str
    source: Source
    draw: Callable[[Shown], dict[str, Any] | None]
    caption: Callable[[Shown], str]
    alt: Callable[[Shown], str]
    height_px: Callable[[TestSheet], int] = lambda sheet: 420
    is_wide: bool = False

    def document(self, shown: Shown) -> dict[str, Any] | None:
        """The figure with its words."""
        drawn = self.draw(shown)
        if drawn is None:
            return None
        return {**drawn, "caption": self.caption(shown), "alt": self.alt(shown)}
