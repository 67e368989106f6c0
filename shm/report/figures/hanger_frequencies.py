"""Predicted over measured frequency of every mode, both planes (as thesis figure 5.18).

Frequency response of the latest test: magnitude, coherence, identified modes.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures import specification as spec
from shm.report.formatting import NORMAL_90, Interval
from shm.report.hanger_summary import misfits_percent
from shm.values import (
    PLANES,
    FloatArray,
    FrequencyResponse,
    Mode,
    Plane,
    PredictedFrequency,
    ResponsePoint,
)

_BESIDE = {"transverse": -0.12, "longitudinal": 0.12}  # layout: beside a mode, apart by a mark


def specify(data: HangerReport) -> spec.Specification | None:
    compared = compared_modes(data)
    if not compared:
        return None
    half = NORMAL_90 * _sigma(data).mean
    known = [mode for mode in data.latest.modes if math.isfinite(mode.frequency_sd_hz)]
    points = [p for plane in PLANES if (p := _points(plane, compared))]
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
    """Those that were predicted and measured."""
    return [mode for mode in data.predicted if math.isfinite(mode.measured_hz)]


def _points(plane: Plane, compared: Sequence[PredictedFrequency]) -> spec.Points | None:
    modes = [mode for mode in compared if mode.plane == plane]
    if not modes:
        return None
    measured = np.array([mode.measured_hz for mode in modes])
    ratio = np.array([mode.mean_hz for mode in modes]) / measured
    half = NORMAL_90 * np.array([mode.sd_hz for mode in modes]) / measured
    return spec.Points(
        x=[mode.order + _BESIDE[plane] for mode in modes], y=ratio, low=ratio - half,
        high=ratio + half, symbol=spec.PLANE_SYMBOLS[plane], colour=spec.PLANE_HUES[plane], size=5,
        name=plane,
        texts=[
            f"{plane} {mode.order}: predicted {mode.mean_hz:.3f} ± {mode.sd_hz:.3f} Hz, measured "
            f"{mode.measured_hz:.3f} Hz"
            for mode in modes
        ],
    )  # fmt: skip


def _measurement(known: Sequence[Mode]) -> spec.Bars:
    """The measurement's own 90 % interval around 1, where its standard deviation is known."""
    half = np.array([NORMAL_90 * mode.frequency_sd_hz / mode.frequency_hz for mode in known])
    return spec.Bars(
        x=[mode.order + _BESIDE[mode.plane] for mode in known], y=2 * half, base=1 - half,
        width=0.2, opacity=0.25, name="measurement, 90 %",
    )  # fmt: skip


def _sigma(data: HangerReport) -> Interval:
    return Interval.of_samples(data.posterior.parameter("sigma"))


def _caption(data: HangerReport) -> str:
    error = formatting.with_interval(_sigma(data).scaled(100), "%")
    return (
        f"Frequencies predicted by {formatting.model_class(data.posterior.model)} after updating, "
        "over the measured ones of the latest test. Bars: 90 % interval that the uncertainty of "
        "the parameters leaves; dark boxes: that of the measurement, where known; light band: "
        f"model error (sigma {error}). A mode outside the band is one that the model does "
        "not explain."
    )


def _alt(data: HangerReport) -> str:
    offs = [off.mean / 100 for _, off in misfits_percent(data)]
    return (
        f"Ratio of predicted to measured frequency of {len(offs)} modes, between "
        f"{1 + min(offs):.4f} and {1 + max(offs):.4f}."
    )


FIGURE = spec.Member("frequencies", "Predicted over measured frequencies", specify, _caption, _alt)


# Layout: curves that can be told apart, room above them for names in rows, and a name that fits.
_POINTS_SHOWN = 4
_HEADROOM = 1.12
_ROWS = {"transverse": 0.98, "longitudinal": 0.93}
_LONGEST_NAME = 14


def specify_response(data: HangerReport) -> spec.Specification | None:
    response = data.frequency_response
    if response is None or not response.points:
        return None
    shown = _shown(response, data.latest.modes)
    frequency_hz = response.frequency_hz[shown]
    across = spec.Axis(
        label="frequency (Hz)", range=(float(frequency_hz[0]), float(frequency_hz[-1]))
    )  # fmt: skip
    curves = _curves(response, shown, np.abs(response.accelerance))
    magnitude = spec.Axis(label="accelerance (m/s²/N)", scale="log")
    marks = [*curves, *_marks(data.latest.modes)]
    if response.coherence is None:
        return spec.stacked([spec.Panel(y=magnitude, marks=marks, x=across)], 3.6, legend_columns=3)
    below = spec.Panel(
        y=spec.Axis(label="coherence", range=(0, 1.05)), x=across,
        marks=_curves(response, shown, response.coherence),
    )  # fmt: skip
    return spec.stacked(
        [spec.Panel(y=magnitude, marks=marks, height=3), below], 4.8, legend_columns=3
    )


def _shown(response: FrequencyResponse, modes: Sequence[Mode]) -> slice:
    """The lines above 0 Hz and a little past the highest identified mode."""
    highest = max((mode.frequency_hz for mode in modes), default=np.inf)
    stop = int(np.searchsorted(response.frequency_hz, _HEADROOM * highest))
    return slice(1, max(stop, 3))


def _curves(response: FrequencyResponse, shown: slice, values: FloatArray) -> list[spec.Mark]:
    return [
        spec.Line(
            x=response.frequency_hz[shown], y=values[index, shown], width=0.9, name=_label(point),
            colour=spec.plane_colour(point.plane), dash="solid" if index < 2 else "dash",
        )
        for index, point in enumerate(response.points[:_POINTS_SHOWN])
    ]  # fmt: skip


def _label(point: ResponsePoint) -> str:
    name = textwrap.shorten(point.name, _LONGEST_NAME, placeholder="…")
    return name if np.isnan(point.x_m) else f"{name} at {point.x_m:.2f} m"


def _marks(modes: Sequence[Mode]) -> list[spec.Mark]:
    """A mark above the curves at each identified mode, a row for each plane."""
    found: list[spec.Mark] = []
    for plane in PLANES:
        at = [mode.frequency_hz for mode in modes if mode.plane == plane]
        look: dict[str, Any] = {"colour": spec.PLANE_HUES[plane]}
        found += [spec.Rule(at=each, axis="x", width=0.5, opacity=0.6, **look) for each in at]
        if at:
            rows = [_ROWS[plane]] * len(at)
            symbol, name = spec.PLANE_SYMBOLS[plane], f"{plane} mode"
            found.append(
                spec.Points(x=at, y=rows, in_shares=True, symbol=symbol, name=name, **look)
            )
    return found


def _response_caption(data: HangerReport) -> str:
    response = data.frequency_response
    points = len(response.points) if response else 0
    some = f" The first {_POINTS_SHOWN} of {points} are drawn." if points > _POINTS_SHOWN else ""
    coherence = (
        "below, coherence (1 where force explains the response)"
        if response and response.coherence is not None
        else "the coherence is not known"
    )
    return (
        "Acceleration per force (accelerance) of the latest test, averaged over the hits; "
        f"{coherence}. Marks and lines: identified modes by plane.{some}"
    )


def _response_alt(data: HangerReport) -> str:
    modes = sorted(data.latest.modes, key=lambda mode: mode.frequency_hz)
    listed = ", ".join(f"{mode.frequency_hz:.2f} Hz ({mode.plane})" for mode in modes)
    return f"Frequency response with {len(modes)} identified modes: {listed}."


RESPONSE = spec.Member(
    "response",
    "Frequency response and identified modes",
    specify_response,
    _response_caption,
    _response_alt,
)
