"""Draw predictions of a model class: curves over one parameter, and a solid's mode in space."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shm.report.figures import style
from shm.report.figures.specification import Axis, Line, Mark, Panel, Specification, limits
from shm.values import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# In a fixed order; dashed where a higher mode begins the list anew.
_HUES = ("blue", "orange", "green", "purple", "red", "quiet")
_ADJACENT_INCHES = 3.2  # layout
_COLUMNS_AN_INCH = 17  # layout: letters of the smallest size, about half as wide as high


@dataclass(frozen=True, eq=False)
class Curves:
    """`y` (points, modes) over `x` (points,), in a panel of their own."""

    title: str
    x: FloatArray
    y: FloatArray


def specify(parts: Sequence[Curves], x_label: str, y_label: str) -> Specification:
    """Return panels side by side with one vertical axis; a mode has one colour in all."""
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
    return Specification(rows=[panels], height_inches=_ADJACENT_INCHES, legend_columns=7)


def write_curves_png(figure: Specification, path: Path, words: str = "") -> None:
    """Return the figure on white, with `words` below."""
    # What draws is loaded where something is drawn.
    from shm.report.figures.with_matplotlib import draw

    path.write_bytes(_png(draw(figure), words))


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


# Layout: how much of the hanger's length the mode is drawn with, how much its section is swollen.
_DRAWN_MOTION, _INCHES = 0.06, 3.4
_SWOLLEN = 2.0


def draw(corners: FloatArray, moved: FloatArray) -> Figure:
    """Draw facets (n, 4, 3) in m, coloured by their motion, the largest 1.

    `SolidModel.surface` gives both.
    """
    # What draws is loaded where something is drawn. The last is a part that ships no types.
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    figure = style.new_figure(_INCHES)
    axes = figure.add_subplot(projection="3d")
    length = float(np.ptp(corners[..., 2]))
    size = np.linalg.norm(moved, axis=-1).mean(axis=1)
    shades = ScalarMappable(Normalize(0, 1), "viridis")
    placed = corners * [_SWOLLEN, _SWOLLEN, 1] + _DRAWN_MOTION * length * moved
    # The hanger lies along the page, its deck end on the left.
    body = Poly3DCollection(placed[..., [2, 1, 0]], facecolors=shades.to_rgba(size), linewidths=0.1)
    body.set_edgecolor((0, 0, 0, 0.25))
    body.set_clip_on(False)
    axes.add_collection3d(body)
    reach = 1.2 * float(np.abs(placed[..., :2]).max())
    axes.set(
        xlim=(corners[..., 2].min(), corners[..., 2].max()),
        ylim=(-reach, reach),
        zlim=(-reach, reach),
    )
    axes.set_xlabel("from the deck end (m)", fontsize=style.TINY, color=style.INK)
    axes.set_box_aspect((4.2, 1, 1), zoom=1.6)
    axes.view_init(elev=18, azim=-75)
    axes.set_yticks([], labels=[])
    axes.set_zticks([], labels=[])
    axes.set_ylabel("y", fontsize=style.TINY, color=style.INK, labelpad=-12)
    axes.set_zlabel("x", fontsize=style.TINY, color=style.INK, labelpad=-12)
    axes.tick_params(labelsize=style.TINY, colors=style.INK)
    bar = figure.colorbar(shades, ax=axes, shrink=0.6, pad=0.1)
    bar.set_label("displacement, largest 1", fontsize=style.TINY, color=style.INK)
    bar.ax.tick_params(labelsize=style.TINY, colors=style.INK)
    return figure


def write_deformed_png(corners: FloatArray, moved: FloatArray, path: Path, words: str = "") -> None:
    """Return the figure of these on white, with `words` below."""
    path.write_bytes(_png(draw(corners, moved), words))


def _png(figure: Figure, words: str) -> bytes:
    """Return the figure on white, with words below it."""
    columns = round(_COLUMNS_AN_INCH * figure.get_figwidth())
    lines = "\n".join(textwrap.wrap(words, columns))
    figure.text(0.01, -0.02, lines, va="top", fontsize=style.TINY, color=style.INK)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, facecolor="white", bbox_inches="tight")
    return buffer.getvalue()
