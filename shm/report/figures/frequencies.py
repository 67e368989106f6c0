"""Predicted over measured frequency of every mode, both planes (as thesis figure 5.18)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.content import NORMAL_90, HangerReport, Interval
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.summary import residuals_percent
from shm.values import PLANES, Plane, PredictedFrequency

_OFFSET = {"transverse": -0.12, "longitudinal": 0.12}


def _draw(data: HangerReport) -> Figure | None:
    compared = _compared(data)
    if not compared:
        return None
    figure = style.new_figure()
    axes = figure.subplots()
    style.dress(axes, "mode number in its plane", "predicted / measured frequency")
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.use_sticky_edges = False
    axes.axhline(1.0, color=style.INK, linewidth=1)
    half = NORMAL_90 * _sigma(data).mean
    axes.axhspan(1 - half, 1 + half, color=style.INK, alpha=0.07, linewidth=0, label="model error")
    for plane in PLANES:
        _points(axes, plane, [mode for mode in compared if mode.plane == plane])
    _measurement(axes, data)
    highest = max(mode.order for mode in compared)
    axes.set_xticks(range(1, highest + 1))
    axes.set_xlim(0.5, highest + 0.5)
    style.legend_above(axes)
    return figure


def _compared(data: HangerReport) -> list[PredictedFrequency]:
    return [mode for mode in data.predicted if math.isfinite(mode.measured_hz)]


def _points(axes: Axes, plane: Plane, modes: list[PredictedFrequency]) -> None:
    if not modes:
        return
    measured = np.array([mode.measured_hz for mode in modes])
    axes.errorbar(
        np.array([mode.order for mode in modes]) + _OFFSET[plane],
        np.array([mode.mean_hz for mode in modes]) / measured,
        yerr=NORMAL_90 * np.array([mode.sd_hz for mode in modes]) / measured,
        color=style.PLANE_COLOURS[plane],
        marker=style.PLANE_MARKERS[plane],
        linestyle="none",
        markersize=5,
        capsize=3,
        label=plane,
    )


def _measurement(axes: Axes, data: HangerReport) -> None:
    """The measurement's own 90 % interval around 1, where its standard deviation is known."""
    known = [mode for mode in data.latest.modes if math.isfinite(mode.frequency_sd_hz)]
    if not known:
        return
    half = [NORMAL_90 * mode.frequency_sd_hz / mode.frequency_hz for mode in known]
    axes.bar(
        [mode.order + _OFFSET[mode.plane] for mode in known],
        [2 * width for width in half],
        bottom=[1 - width for width in half],
        width=0.2,
        color=style.INK,
        alpha=0.25,
        linewidth=0,
        label="measurement, 90 %",
    )


def _sigma(data: HangerReport) -> Interval:
    return Interval.of_samples(data.posterior.parameter("sigma"))


def _model_error(data: HangerReport) -> str:
    return "sigma " + words.with_interval(_sigma(data).scaled(100), "%")


def _caption(data: HangerReport) -> str:
    return (
        f"Frequencies predicted by {words.model_class(data.posterior.model)} after updating, over "
        "the measured ones of the latest test. Bars: 90 % interval that the uncertainty of the "
        "parameters leaves; dark boxes: that of the measurement, where known; light band: model "
        f"error ({_model_error(data)}). A mode outside the band is one that the model does not "
        "explain."
    )


def _alt(data: HangerReport) -> str:
    residuals = residuals_percent(data.predicted)
    return (
        f"Ratio of predicted to measured frequency of {len(residuals)} modes, between "
        f"{1 + min(residuals) / 100:.4f} and {1 + max(residuals) / 100:.4f}."
    )


FIGURE = Member("frequencies", "Predicted over measured frequencies", _draw, _caption, _alt)
