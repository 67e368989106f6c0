"""Stabilisation diagram: poles over model order, the spectrum behind, what was chosen.

Damping and uncertainty of the modes over frequency.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.report.figures.modal_test_response import (
    Shown,
    Spectrum,
    mode_marks,
    shown_range,
    with_headroom,
)
from shm.report.figures.specification import (
    PLANE_HUES,
    PLANE_SYMBOLS,
    Axis,
    Line,
    Mark,
    Member,
    Panel,
    Points,
    Specification,
    Symbol,
    envelope_places,
    log_axis,
    stacked,
)
from shm.report.formatting import NORMAL_90
from shm.values import PLANES, BoolArray, FloatArray, Mode

# Layout: as many bins as a page has dots; a scale is never narrower than two orders.
_BINS = 550
_LEAST_SPAN = 2.0


def _draw(shown: Shown) -> Specification | None:
    poles = shown.sheet.identification.poles
    if not len(poles.order):
        return None
    low, high = shown_range(shown.sheet)
    lowest, highest = float(poles.order.min()), float(poles.order.max())
    bottom = lowest - 0.03 * max(highest - lowest, _LEAST_SPAN)
    step = next((each for each in (1, 2, 5, 10, 20, 50) if 6 * each >= highest), 100)
    orders = Axis(
        label="model order", range=with_headroom(bottom, 1.02 * highest),
        ticks=np.arange(0, highest + 1, step).tolist(),
    )  # fmt: skip
    marks = [
        *(_background(shown.spectrum, low, high, bottom, highest) if shown.spectrum else []),
        _poles(shown, ~poles.stable, "dropped pole", "thin cross", "quiet"),
        _poles(shown, poles.stable, "stable pole", "circle", "green"),
        *mode_marks(shown.sheet, low, high),
    ]
    across = Axis(label="frequency (Hz)", range=(low, high))
    return stacked([Panel(y=orders, marks=marks, x=across)], 4.2, legend_columns=3)


def _poles(shown: Shown, which: BoolArray, name: str, symbol: Symbol, colour: str) -> Points:
    poles = shown.sheet.identification.poles
    return Points(
        x=poles.frequency_hz[which], y=poles.order[which], symbol=symbol, size=3.0, colour=colour,
        name=name, texts=[f"{100 * ratio:.2g}" for ratio in poles.damping_ratio[which]],
        hover="%{x:.3f} Hz, order %{y}, damping %{text} %",
    )  # fmt: skip


def _background(
    found: Spectrum, low_hz: float, high_hz: float, bottom: float, top: float
) -> list[Mark]:
    """The spectrum over all points, its logarithm between the lowest order and the highest."""
    start, stop = np.searchsorted(found.frequency_hz, [low_hz, high_hz])
    lines = slice(max(1, int(start)), int(stop) + 1)
    values = found.together[lines]
    known = values[np.isfinite(values) & (values > 0)]
    if not len(known):
        return []
    places = envelope_places(values, _BINS)
    least, most = np.log10([0.5 * np.quantile(known, 0.01), known.max()])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (np.log10(values[places]) - least) / (most - least)
    name = "spectrum of all points (log scale)"
    return [
        Line(
            x=found.frequency_hz[lines][places], y=bottom + (top - bottom) * share, width=0.8,
            colour="quiet", opacity=0.6, name=name,
        )
    ]  # fmt: skip


def _caption(shown: Shown) -> str:
    poles = shown.sheet.identification.poles
    stable = int(np.sum(poles.stable))
    return (
        f"{len(poles.order)} poles over the order of the model that gave them, {stable} of them "
        "stable; a column of stable poles is a mode. Marks on top: the chosen modes by plane, and "
        "what was set aside."
    )


def _alt(shown: Shown) -> str:
    listed = ", ".join(f"{m.plane} {m.order} at {m.frequency_hz:.2f} Hz" for m in shown.sheet.modes)
    return f"Stabilisation diagram with {len(shown.sheet.modes)} chosen modes: {listed}."


FIGURE = Member("stabilisation", "Stabilisation diagram", _draw, _caption, _alt)


_LEAST_DAMPING_SPAN = 30.0
"""Of the axis of intervals: equal ones shall look equal."""


def _draw_damping(shown: Shown) -> Specification | None:
    damped = [m for m in shown.sheet.modes if math.isfinite(m.damping_ratio)]
    sure = [m for m in shown.sheet.modes if m.frequency_sd_hz > 0]
    across = Axis(label="frequency (Hz)", range=shown_range(shown.sheet))
    panels = []
    if damped:
        panels.append(_damping(damped, None if sure else across))
    if sure:
        panels.append(_uncertainty(sure, across))
    return stacked(panels, 4.6 if sure else 2.9) if panels else None


def _damping(modes: Sequence[Mode], across: Axis | None) -> Panel:
    value = np.array([100 * mode.damping_ratio for mode in modes])
    half = np.nan_to_num([100 * NORMAL_90 * mode.damping_sd for mode in modes])
    axis = Axis(label="damping ratio (%)", range=(0, 1.1 * float(max(value + half))))
    return Panel(y=axis, marks=_marks(modes, value, half), x=across)


def _uncertainty(modes: Sequence[Mode], across: Axis) -> Panel:
    """Half the 90 % interval of each frequency, in percent of it."""
    value = np.array([100 * NORMAL_90 * m.frequency_sd_hz / m.frequency_hz for m in modes])
    low, high = float(min(value)), float(max(value))
    room = max(1.3, math.sqrt(_LEAST_DAMPING_SPAN * low / high))
    axis = log_axis("90 % interval of\nthe frequency (± %)", low / room, high * room)
    return Panel(y=axis, marks=_marks(modes, value), x=across)


def _marks(modes: Sequence[Mode], value: FloatArray, half: FloatArray | None = None) -> list[Mark]:
    found: list[Mark] = []
    for plane in PLANES:
        own = [place for place, mode in enumerate(modes) if mode.plane == plane]
        if own:
            found.append(
                Points(
                    x=[modes[place].frequency_hz for place in own], y=value[own],
                    low=None if half is None else (value - half)[own],
                    high=None if half is None else (value + half)[own],
                    symbol=PLANE_SYMBOLS[plane], colour=PLANE_HUES[plane], name=plane,
                    texts=[f"{plane} {modes[place].order}" for place in own],
                    hover="%{text}: %{x:.4g} Hz, %{y:.3g} %",
                )
            )  # fmt: skip
    return found


def _damping_caption(shown: Shown) -> str:
    known = any(math.isfinite(mode.damping_sd) for mode in shown.sheet.modes)
    bars = "bars are 90 % intervals" if known else "its uncertainty is not known"
    return (
        f"Damping of each mode, {bars}. A mode damped quite unlike its neighbours, or one whose "
        "frequency is far less sure than theirs, deserves a second look."
    )


def _damping_alt(shown: Shown) -> str:
    percent = [100 * mode.damping_ratio for mode in shown.sheet.modes]
    return (
        f"Damping ratios of {len(percent)} modes between {min(percent):.2g} and "
        f"{max(percent):.2g} %, by frequency and plane."
    )


DAMPING = Member(
    "damping", "Damping and uncertainty", _draw_damping, _damping_caption, _damping_alt
)
