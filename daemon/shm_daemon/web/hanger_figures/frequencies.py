"""Predicted over measured frequency of every mode, with what is uncertain of both."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shm.report import HangerReport, Interval
from shm.report.content import NORMAL_90
from shm.report.figures.frequencies import FIGURE as OF_REPORT
from shm.values import PLANES, Plane, PredictedFrequency
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

_BESIDE = {"transverse": -0.12, "longitudinal": 0.12}
_LOOKS = {"transverse": ("blue", "circle"), "longitudinal": ("orange", "square")}


def _report(view: HangerView) -> HangerReport:
    assert view.report is not None
    return view.report


def _compared(view: HangerView) -> list[PredictedFrequency]:
    if view.report is None:
        return []
    return [mode for mode in view.report.predicted if math.isfinite(mode.measured_hz)]


def _draw(view: HangerView) -> dict[str, Any]:
    compared = _compared(view)
    highest = max(mode.order for mode in compared)
    ends = [0.5, highest + 0.5]
    traces = [
        *_model_error(view, ends),
        *_measurement(_report(view)),
        *(_plane(plane, [m for m in compared if m.plane == plane]) for plane in PLANES),
    ]
    return figure(
        traces,
        "mode number in its plane",
        "predicted / measured frequency",
        xaxis={"range": ends, "dtick": 1 if highest <= 16 else 2, "tick0": 1, "showgrid": False},
        hovermode="closest",
        barmode="overlay",
    )


def _plane(plane: Plane, modes: list[PredictedFrequency]) -> Trace:
    hue, symbol = _LOOKS[plane]
    measured = np.array([mode.measured_hz for mode in modes])
    mean, sd = (np.array([getattr(mode, name) for mode in modes]) for name in ("mean_hz", "sd_hz"))
    return {
        "type": "scatter", "mode": "markers", "name": plane,
        "x": [mode.order + _BESIDE[plane] for mode in modes], "y": mean / measured,
        "error_y": {
            "type": "data", "array": NORMAL_90 * sd / measured, "color": colour(hue),
            "thickness": 1.5,
        },
        "marker": {"color": colour(hue), "symbol": symbol, "size": 9},
        "text": [
            f"{plane} {mode.order}: predicted {mode.mean_hz:.3f} ± {mode.sd_hz:.3f} Hz, measured "
            f"{mode.measured_hz:.3f} Hz"
            for mode in modes
        ],
        "hovertemplate": "%{text}<extra></extra>",
    }  # fmt: skip


def _model_error(view: HangerView, ends: list[float]) -> list[Trace]:
    """The light band of the model error, and the line where both agree."""
    posterior = _report(view).posterior
    half = NORMAL_90 * Interval.of_samples(posterior.parameter("sigma")).mean
    edge = {
        "type": "scatter", "x": ends, "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip",
        "legendgroup": "model",
    }  # fmt: skip
    return [
        {**edge, "y": [1 - half] * 2, "showlegend": False},
        {
            **edge, "y": [1 + half] * 2, "fill": "tonexty", "fillcolor": colour("ink", 0.09),
            "name": "model error",
        },
        {
            **edge, "y": [1, 1], "line": {"color": colour("ink"), "width": 1}, "showlegend": False,
        },
    ]  # fmt: skip


def _measurement(report: HangerReport) -> list[Trace]:
    """The measurement's own 90 % interval about 1, where its standard deviation is known."""
    known = [mode for mode in report.latest.modes if math.isfinite(mode.frequency_sd_hz)]
    if not known:
        return []
    half = np.array([NORMAL_90 * mode.frequency_sd_hz / mode.frequency_hz for mode in known])
    return [
        {
            "type": "bar", "name": "measurement, 90 %", "base": 1 - half, "y": 2 * half,
            "x": [mode.order + _BESIDE[mode.plane] for mode in known], "width": 0.2,
            "marker": {"color": colour("ink", 0.25)}, "hoverinfo": "skip",
        }
    ]  # fmt: skip


FIGURE = HangerFigure(
    "frequencies",
    "Predicted over measured frequencies",
    "model",
    lambda view: bool(_compared(view)),
    _draw,
    lambda view: OF_REPORT.caption(_report(view)),
    lambda view: OF_REPORT.alt(_report(view)),
    height_px=380,
)
