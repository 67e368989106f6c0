"""Define the style of all figures: size, letters, quiet axes, distinguishable colours.

A word is written next to each colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from shm.values import Verdict

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.legend import Legend

INK = "#1d2330"
GRID = "#d5d9e0"
BLUE = "#0072b2"
ORANGE = "#d55e00"
GREEN = "#009e73"
PURPLE = "#9b4f96"
RED = "#b00020"
QUIET = "#565f70"
# Okabe and Ito (2008), darkened where small marks need it; names are the page's CSS variables.
PALETTE = {
    "ink": INK,
    "grid": GRID,
    "blue": BLUE,
    "orange": ORANGE,
    "green": GREEN,
    "purple": PURPLE,
    "red": RED,
    "quiet": QUIET,
}
STATUS_COLOURS = {
    "alert": RED,
    "watch": ORANGE,
    "check": ORANGE,
    "unclear": ORANGE,
    "steady": GREEN,
    "first": BLUE,
}
"""By the page's style of a state."""
VERDICT_COLOURS: dict[Verdict, str] = {
    "good": GREEN,
    "warning": ORANGE,
    "refused": RED,
    "unknown": QUIET,
}
VERDICT_STYLES: dict[Verdict, str] = {
    "good": "steady",
    "warning": "watch",
    "refused": "alert",
    "unknown": "first",
}
"""The page's style of a whole test's verdict."""


WIDTH_INCHES = 7.4
_SMALL = 9.0
TINY = 7.5
"""Size of letters where many panels share a figure, in points."""


def new_figure(height_inches: float = 3.4) -> Figure:
    """Return an empty figure of the page's width, with no pyplot behind it."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH_INCHES, height_inches), layout="constrained", facecolor="none")


def stacked(figure: FigureBase, heights: Sequence[float]) -> list[Axes]:
    """Return panels one below the other over one axis, with these fractions of the height."""
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)
    return list(panels[:, 0])


def dress(axes: Axes, x_label: str, y_label: str) -> None:
    """Set labels, grid and spines."""
    axes.set_facecolor("none")
    axes.set_xlabel(x_label, fontsize=_SMALL, color=INK)
    axes.set_ylabel(y_label, fontsize=_SMALL, color=INK)
    axes.tick_params(which="both", labelsize=_SMALL, colors=INK)
    axes.grid(True, color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_color(INK)
        spine.set_visible(side in ("left", "bottom"))


_QUIET_LEGEND: dict[str, Any] = {
    "labelcolor": INK, "frameon": False, "borderaxespad": 0.2, "columnspacing": 1.4
}  # fmt: skip


def legend_above(axes: Axes, columns: int = 4) -> Legend:
    """Return a legend over the plot, where it hides no data."""
    return axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, fontsize=_SMALL,
        handlelength=1.6, **_QUIET_LEGEND,
    )  # fmt: skip


def legend_of_figure(
    figure: FigureBase, axes: Sequence[Axes], columns: int = 4, where: str = "outside upper left"
) -> None:
    """Draw one legend over the figure for all `axes`, each name once; none without names."""
    named: dict[str, Artist] = {}
    for each in axes:
        handles, names = each.get_legend_handles_labels()
        named = {**dict(zip(names, handles, strict=True)), **named}
    if named:
        figure.legend(
            list(named.values()),
            list(named),
            loc=where,  # type: ignore[call-overload]
            ncols=columns,
            fontsize=TINY + 1,
            handlelength=2.0,
            **_QUIET_LEGEND,
        )
