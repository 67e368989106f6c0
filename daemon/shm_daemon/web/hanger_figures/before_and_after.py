"""How far the gap of each mode shrinks: baseline, with the cause, held out of its fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shm.report.diagnosis.content import claimed
from shm.report.diagnosis.figures.before_and_after import FIGURE as OF_REPORT
from shm.report.diagnosis.figures.modes import kept, orders
from shm.values import Plane, Residual
from shm_daemon.web.hanger_figures.by_mode import LOOKS, axes_of, by_plane, marks, sheet_of
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour


@dataclass(frozen=True)
class _Series:
    """One of the residuals of a mode; an empty colour is that of the plane."""

    field: str
    name: str
    symbol: str
    hue: str
    offset: float


_SERIES = (
    _Series("residual_percent", "baseline", "circle-open", "quiet", -0.2),
    _Series("after_percent", "with the cause", "circle", "", 0.0),
    _Series("held_out_after_percent", "with the cause, held out", "diamond", "green", 0.2),
)


def _residuals(view: HangerView) -> list[Residual]:
    if view.sheet is None or claimed(view.sheet.diagnosis) is None:
        return []
    return [r for r in kept(view.sheet) if math.isfinite(r.after_percent)]


def _draw(view: HangerView) -> dict[str, Any]:
    residuals = _residuals(view)
    traces = [
        _points([r for r in residuals if r.plane == plane], plane, series, y_axis)
        for plane, y_axis in axes_of(residuals).items()
        for series in _SERIES
    ]
    return by_plane(traces, residuals, "gap (%)")


def _points(residuals: Sequence[Residual], plane: Plane, series: _Series, y_axis: str) -> Trace:
    """The mean over the tests with a bar from the least to the largest."""
    there = [
        (order, values)
        for order in orders(residuals, plane)
        if len(values := _values(residuals, order, series.field))
    ]
    means = np.array([float(np.mean(values)) for _, values in there])
    hue = series.hue or LOOKS[plane][0]
    bars = {
        "type": "data", "symmetric": False, "color": colour(hue, 0.6), "width": 0,
        "array": np.array([max(values) for _, values in there]) - means,
        "arrayminus": means - np.array([min(values) for _, values in there]),
    }  # fmt: skip
    x = [order + series.offset for order, _ in there]
    return marks(
        x, means.tolist(), series.name, y_axis, hue, series.symbol, error_y=bars,
        hovertemplate=f"{plane}, {series.name}: %{{y:.2f}} %<extra></extra>",
    )  # fmt: skip


def _values(residuals: Sequence[Residual], order: int, field: str) -> list[float]:
    found = [getattr(r, field) for r in residuals if r.order == order]
    return [value for value in found if math.isfinite(value)]


FIGURE = HangerFigure(
    "before_and_after",
    "How far the gap shrinks",
    "gap",
    lambda view: bool(_residuals(view)),
    _draw,
    lambda view: OF_REPORT.caption(sheet_of(view)),
    lambda view: OF_REPORT.alt(sheet_of(view)),
    height_px=480,
)
