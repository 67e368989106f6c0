"""Predicted over measured frequency of every mode, both planes (as thesis figure 5.18)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures import specification as spec
from shm.report.formatting import NORMAL_90, Interval
from shm.values import (
    PLANES,
    Mode,
    Plane,
    PredictedFrequency,
)

_NEXT_TO = {"transverse": -0.12, "longitudinal": 0.12}  # layout: beside a mode, apart by a mark


def specify(data: HangerReport) -> spec.Specification | None:
    compared = compared_modes(data)
    if not compared:
        return None
    half = NORMAL_90 * _sigma(data).mean
    known = [mode for mode in data.latest.modes if math.isfinite(mode.frequency_sd_hz)]
    points = [p for plane in PLANES if (p := _points(plane, data.misfits_percent))]
    marks: list[spec.Mark] = [
        spec.Span(low=1 - half, high=1 + half, axis="y", opacity=0.07, name="model error"),
        spec.Rule(at=1.0),
        *([_measurement(known)] if known else []),
        *points,
    ]
    highest = max(mode.order for mode in compared)
    ends = [end for each in points for end in (each.low, each.high)]
    step = 1 if highest <= 16 else 2
    panel = spec.Panel(
        y=spec.Axis(
            label="predicted / measured frequency",
            range=spec.limits([1 - half, 1 + half], *ends),
        ),
        marks=marks,
        x=spec.Axis(
            label="mode number in its plane", range=(0.5, highest + 0.5), grid=False,
            ticks=range(1, highest + 1, step),
        ),
    )  # fmt: skip
    return spec.stacked([panel], 3.4)


def compared_modes(data: HangerReport) -> list[PredictedFrequency]:
    """Return the modes that were predicted and measured."""
    return [mode for mode in data.predicted if math.isfinite(mode.measured_hz)]


def _points(
    plane: Plane, misfits: Sequence[tuple[PredictedFrequency, Interval]]
) -> spec.Points | None:
    of_plane = [(mode, off) for mode, off in misfits if mode.plane == plane]
    if not of_plane:
        return None
    modes = [mode for mode, _ in of_plane]
    ratio, low, high = 1 + np.array([(off.mean, off.low, off.high) for _, off in of_plane]).T / 100
    return spec.Points(
        x=[mode.order + _NEXT_TO[plane] for mode in modes], y=ratio, low=low,
        high=high, symbol=spec.PLANE_SYMBOLS[plane], colour=spec.PLANE_HUES[plane], size=5,
        name=plane,
        texts=[
            f"{plane} {mode.order}: predicted {mode.mean_hz:.3f} ± {mode.sd_hz:.3f} Hz, measured "
            f"{mode.measured_hz:.3f} Hz"
            for mode in modes
        ],
    )  # fmt: skip


def _measurement(known: Sequence[Mode]) -> spec.Bars:
    """Return the measurement's 90 % interval around 1, where its standard deviation is known."""
    half = np.array([NORMAL_90 * mode.frequency_sd_hz / mode.frequency_hz for mode in known])
    return spec.Bars(
        x=[mode.order + _NEXT_TO[mode.plane] for mode in known], y=2 * half, base=1 - half,
        width=0.2, opacity=0.25, name="measurement, 90 %",
    )  # fmt: skip


def _sigma(data: HangerReport) -> Interval:
    return Interval.of_samples(data.posterior.parameter("sigma"))


def _caption(data: HangerReport) -> str:
    error = formatting.with_interval(_sigma(data).scaled(100), "%")
    return (
        f"Frequencies predicted by {formatting.model_class(data.posterior.model)} after updating, "
        "over the measured ones of the latest test. Bars: 90 % interval of prediction and "
        "measurement together; dark boxes: that of the measurement alone, where known; light "
        f"band: model error (sigma {error}). A bar that does not reach 1 is a mode that the model "
        "does not explain."
    )


def _alt(data: HangerReport) -> str:
    offs = [off.mean / 100 for _, off in data.misfits_percent]
    return (
        f"Ratio of predicted to measured frequency of {len(offs)} modes, between "
        f"{1 + min(offs):.4f} and {1 + max(offs):.4f}."
    )


FIGURE = spec.FigureSpec(
    "frequencies", "Predicted over measured frequencies", specify, _caption, _alt
)
