"""What the figures over planes and orders share."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from shm.report.diagnosis.content import DiagnosisSheet, is_set_aside
from shm.report.figures import style
from shm.values import PLANES, Plane, Residual

ZERO_WIDTH = 0.8


def measured(sheet: DiagnosisSheet) -> list[Residual]:
    """The residuals that are known."""
    return [r for r in sheet.diagnosis.where if math.isfinite(r.residual_percent)]


def kept(sheet: DiagnosisSheet) -> list[Residual]:
    """Those of them that were not set aside as gross errors."""
    return [r for r in measured(sheet) if not is_set_aside(sheet.diagnosis, r)]


def aside(sheet: DiagnosisSheet) -> list[Residual]:
    """Those of them that were."""
    return [r for r in measured(sheet) if is_set_aside(sheet.diagnosis, r)]


def planes(residuals: Sequence[Residual]) -> list[Plane]:
    return [plane for plane in PLANES if any(r.plane == plane for r in residuals)]


def orders(residuals: Sequence[Residual], plane: Plane) -> list[int]:
    return sorted({r.order for r in residuals if r.plane == plane})


def panels(figure: FigureBase, residuals: Sequence[Residual], y_label: str) -> dict[Plane, Axes]:
    """A panel for each plane that was measured, over its orders, with one vertical axis."""
    found = planes(residuals)
    made = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for plane, axes in zip(found, made, strict=True):
        there = orders(residuals, plane)
        style.dress(axes, "order of the mode", y_label if axes is made[0] else "")
        axes.axhline(0, color=style.INK, linewidth=ZERO_WIDTH)
        axes.set_xlim(there[0] - 0.6, there[-1] + 0.6)
        axes.set_xticks(there if len(there) <= 12 else there[:: math.ceil(len(there) / 12)])
        axes.grid(False, axis="x")
        colour = style.PLANE_COLOURS[plane]
        axes.set_title(f"{plane} plane", fontsize=9, color=colour, loc="left")
    return dict(zip(found, made, strict=True))
