"""What all figures share: size, letters, quiet axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shm.report import colours

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.legend import Legend

WIDTH_INCHES = 7.4
_SMALL = 9.0
TINY = 7.5
"""Size of letters where many panels share a figure, in points."""


def new_figure(height_inches: float = 3.4) -> Figure:
    """An empty figure of the page's width, with no pyplot behind it."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH_INCHES, height_inches), layout="constrained", facecolor="none")


def stacked(figure: FigureBase, heights: Sequence[float]) -> list[Axes]:
    """Panels one below the other over one horizontal axis, with these shares of the height."""
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)
    return list(panels[:, 0])


def dress(axes: Axes, x_label: str, y_label: str) -> None:
    """Labels, grid and spines."""
    axes.set_facecolor("none")
    axes.set_xlabel(x_label, fontsize=_SMALL, color=colours.INK)
    axes.set_ylabel(y_label, fontsize=_SMALL, color=colours.INK)
    axes.tick_params(which="both", labelsize=_SMALL, colors=colours.INK)
    axes.grid(True, color=colours.GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_color(colours.INK)
        spine.set_visible(side in ("left", "bottom"))


def legend_above(axes: Axes, columns: int = 4) -> Legend:
    """A legend over the plot, where it hides no data."""
    return axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        fontsize=_SMALL,
        labelcolor=colours.INK,
        frameon=False,
        borderaxespad=0.2,
        handlelength=1.6,
        columnspacing=1.4,
    )


def legend_of_figure(
    figure: FigureBase, axes: Sequence[Axes], columns: int = 4, where: str = "outside upper left"
) -> None:
    """One legend over the whole figure for all `axes`, each name once; none where nothing has."""
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
            labelcolor=colours.INK,
            frameon=False,
            borderaxespad=0.2,
            handlelength=2.0,
            columnspacing=1.4,
        )
