"""Curves against one parameter: modal frequencies of a sweep, or dimensionless ones of a beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from shm.report.figures import illustration
from shm.report.figures.specification import Axis, Line, Mark, Panel, Specification, limits
from shm.values import FloatArray

# In a fixed order; dashed where a higher mode begins the list anew.
_HUES = ("blue", "orange", "green", "purple", "red", "quiet")
_ASIDE_INCHES = 3.2  # layout


@dataclass(frozen=True, eq=False)
class Curves:
    """`y` (points, modes) over `x` (points,), in a panel of their own."""

    title: str
    x: FloatArray
    y: FloatArray


def specify(parts: Sequence[Curves], x_label: str, y_label: str) -> Specification:
    """Panels side by side with one vertical axis; a mode has one colour in all of them."""
    bounds = limits(*(each.y.ravel() for each in parts))
    panels = [
        Panel(
            x=Axis(label=x_label, range=(float(each.x.min()), float(each.x.max()))),
            y=Axis(label=y_label if place == 0 else "", range=bounds),
            marks=_lines(each),
            title=each.title,
            title_side="left",
            shares_y=place > 0,
        )
        for place, each in enumerate(parts)
    ]
    return Specification(rows=[panels], height_inches=_ASIDE_INCHES, legend_columns=7)


def write_png(figure: Specification, path: Path, words: str = "") -> None:
    """The figure on white, with `words` below."""
    # What draws is loaded where something is drawn.
    from shm.report.figures.with_matplotlib import draw

    path.write_bytes(illustration.png(draw(figure), words=words))


def _lines(curves: Curves) -> list[Mark]:
    return [
        Line(
            x=curves.x,
            y=row,
            colour=_HUES[place % len(_HUES)],
            dash="dash" if place >= len(_HUES) else "solid",
            name=f"mode {place + 1}",
        )
        for place, row in enumerate(curves.y.T)
    ]
