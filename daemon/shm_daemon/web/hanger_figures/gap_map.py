"""Where the gap lies: the residual of each mode and test by plane and order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from shm.report import words
from shm.report.content import NORMAL_90
from shm.report.diagnosis.figures.below_map import CLEAR_SD
from shm.report.diagnosis.figures.gap_map import FIGURE as OF_REPORT
from shm.report.diagnosis.figures.modes import aside, kept, measured
from shm.values import Residual
from shm_daemon.web.hanger_figures.by_mode import LOOKS, axes_of, by_plane, marks, sheet_of
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour

_SPREAD = 0.6
"""Width over which the tests of one mode stand side by side, in orders."""


def _draw(view: HangerView) -> dict[str, Any]:
    sheet = sheet_of(view)
    residuals, tests = measured(sheet), sheet.diagnosis.tests
    traces = [
        trace
        for plane, y_axis in axes_of(residuals).items()
        for name, found in _kinds([r for r in kept(sheet) if r.plane == plane])
        for trace in [_ordinary(found, tests, name, y_axis)]
    ]
    traces += [
        _gross([r for r in aside(sheet) if r.plane == plane], tests, y_axis)
        for plane, y_axis in axes_of(residuals).items()
        if any(r.plane == plane for r in aside(sheet))
    ]
    return by_plane(traces, residuals, "gap (%)")


def _kinds(residuals: Sequence[Residual]) -> list[tuple[str, list[Residual]]]:
    """Those that are clear, those that may be chance, those of which that is not known."""
    return [
        ("beyond 2 sd", [r for r in residuals if abs(r.z) >= CLEAR_SD]),
        ("within 2 sd", [r for r in residuals if abs(r.z) < CLEAR_SD]),
        ("sd not known", [r for r in residuals if math.isnan(r.z)]),
    ]


def _ordinary(found: list[Residual], tests: Sequence[str], name: str, y_axis: str) -> Trace:
    if not found:
        return marks([], [], name, y_axis, "quiet", "circle", hoverinfo="skip", visible=False)
    hue, symbol = LOOKS[found[0].plane]
    shape = {"beyond 2 sd": symbol, "within 2 sd": f"{symbol}-open", "sd not known": "x-thin-open"}
    sd = [_sd_percent(residual) for residual in found]
    bars = {
        "type": "data", "array": [NORMAL_90 * each for each in sd], "color": colour(hue, 0.55),
        "thickness": 1.2, "width": 0,
    }  # fmt: skip
    return _with_names(
        found, marks(*_at(found, tests), name, y_axis, hue, shape[name], error_y=bars)
    )


def _gross(found: list[Residual], tests: Sequence[str], y_axis: str) -> Trace:
    made = marks(*_at(found, tests), "set aside", y_axis, "red", "x", showlegend=True)
    return _with_names(found, made)


def _at(found: Sequence[Residual], tests: Sequence[str]) -> tuple[list[float], list[float]]:
    x = [r.order + _offset(r.test, tests) for r in found]
    return x, [r.residual_percent for r in found]


def _offset(test: str, tests: Sequence[str]) -> float:
    if test not in tests or len(tests) < 2:
        return 0.0
    return _SPREAD * (tests.index(test) / (len(tests) - 1) - 0.5)


def _sd_percent(residual: Residual) -> float:
    """The standard deviation that the z-score was counted in."""
    return abs(residual.residual_percent / residual.z) if residual.z else math.nan


def _with_names(found: Sequence[Residual], trace: Trace) -> Trace:
    text = [
        f"{r.plane} {r.order}, {r.test}: {r.residual_percent:+.2f} %, measured "
        f"{words.number(r.measured_hz, '.3f')} Hz"
        for r in found
    ]
    return {**trace, "text": text, "hovertemplate": "%{text}<extra></extra>"}


def _caption(view: HangerView) -> str:
    sheet = sheet_of(view)
    several = len(sheet.diagnosis.tests) > 1
    order = " The tests of one mode stand side by side in their order." if several else ""
    crosses = " Crosses: gross errors, set aside." if aside(sheet) else ""
    return (
        f"Measured frequency over what the baseline {sheet.diagnosis.baseline} predicts at its "
        "best, less 1, by plane and order. Bars: 90 % interval of the measurement and of what the "
        f"baseline leaves open; filled: beyond 2 standard deviations.{crosses}{order}"
    )


FIGURE = HangerFigure(
    "gap_map",
    "Where the gap lies",
    "gap",
    lambda view: view.sheet is not None and bool(measured(view.sheet)),
    _draw,
    _caption,
    lambda view: OF_REPORT.alt(sheet_of(view)),
    height_px=480,
)
