"""What the figures over planes and orders share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_wording import is_set_aside
from shm.report.figures.specification import PLANE_HUES, Axis, Mark, Panel, Rule
from shm.values import PLANES, Plane, Residual


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


def by_plane(
    made: Mapping[Plane, Sequence[Mark]],
    residuals: Sequence[Residual],
    y: Axis,
    is_on_screen: bool,
) -> list[list[Panel]]:
    """A panel of marks for each plane over its orders, with one vertical axis.

    They stand side by side on paper, one below the other on a screen, which may be narrow."""
    panels: list[Panel] = []
    for plane, marks in made.items():
        there = orders(residuals, plane)
        if is_on_screen:
            there = sorted({r.order for r in residuals})
        is_alone = is_on_screen or not panels
        panels.append(
            Panel(
                y=y if is_alone else replace(y, label=""), marks=[Rule(at=0, width=0.8), *marks],
                x=Axis(
                    label="order of the mode", range=(there[0] - 0.6, there[-1] + 0.6), grid=False,
                    ticks=there[:: math.ceil(len(there) / 12)],
                ),
                title=f"{plane} plane", title_colour=PLANE_HUES[plane], title_side="left",
                shares_y=bool(panels),
            )
        )  # fmt: skip
    if not is_on_screen:
        return [panels]
    return [[replace(panel, x=None)] for panel in panels[:-1]] + [panels[-1:]]
