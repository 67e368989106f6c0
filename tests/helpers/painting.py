"""Figures that are drawn but not painted: painting takes most of a report's time."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from shm.report.figures.specification import Illustration


def unpaint(patch: pytest.MonkeyPatch) -> None:
    """Every picture is the same small blank one."""
    painted = blank(1.0, 1.0, 10)
    patch.setattr(Illustration, "svg", lambda _: "<svg></svg>")
    patch.setattr(Illustration, "png", lambda *_: painted)


def paint_blank(patch: pytest.MonkeyPatch) -> None:
    """Every picture has its figure's size and fineness, and nothing on it."""

    def png(item: Illustration, dots_per_inch: int = 150) -> bytes:
        return blank(*item.figure.get_size_inches(), dots_per_inch)

    patch.setattr(Illustration, "png", png)


def blank(width_inches: float, height_inches: float, dots_per_inch: int) -> bytes:
    """A white PNG."""
    return _PAINT(
        Illustration("", "", "", "", Figure((width_inches, height_inches))), dots_per_inch
    )


_PAINT = Illustration.png
