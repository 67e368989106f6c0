"""Frequency response at a few points with the modal fit over it, phase and coherence.

Of an ambient test, in which nobody hit, the spectral density stands instead.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.sheet.content import TestSheet
from shm.report.sheet.figures.marks import HEADROOM, mark_modes
from shm.report.sheet.spectra import Spectrum, shown_points, shown_range, spectrum
from shm.report.sheet.thinning import envelope_places, peak_places
from shm.values import ComplexArray, FloatArray, ResponsePoint

_MOST_POINTS = 4
_BINS = 550
_PHASE_TICKS = (0, 180)


def _draw(sheet: TestSheet) -> Figure | None:
    found = spectrum(sheet)
    if found is None:
        return None
    shown = shown_points(sheet, found, _MOST_POINTS)
    response = sheet.identification.frequency_response
    coherent = response is not None and response.coherence is not None
    heights = [1.35, 0.62][: 1 if response is None else 2] * len(shown) + [0.7] * coherent
    figure = style.new_figure(sum(heights) + 0.7)
    rows = style.stacked(figure, heights)
    low, high = shown_range(sheet)
    rows[0].set_xlim(low, min(high, found.frequency_hz[-1]))
    each = 1 if response is None else 2
    for place, index in enumerate(shown):
        _magnitude(rows[each * place], sheet, found, index)
        if response is not None:
            _phase(rows[each * place + 1], sheet, index)
    if coherent:
        _coherence(rows[-1], sheet, shown)
    style.dress(rows[-1], "frequency (Hz)", rows[-1].get_ylabel())
    style.legend_of_figure(figure, rows[:1], columns=3)
    return figure


def _lines(frequency_hz: FloatArray, axes: Axes) -> slice:
    """The lines within the axis; that at 0 Hz says nothing of a response."""
    low, high = axes.get_xlim()
    start, stop = np.searchsorted(frequency_hz, [low, high], side="right")
    return slice(max(1, int(start) - 1), int(stop) + 1)


def _magnitude(axes: Axes, sheet: TestSheet, found: Spectrum, index: int) -> None:
    point = found.points[index]
    style.dress(axes, "", _short(found.quantity))
    axes.set_yscale("log")
    lines = _lines(found.frequency_hz, axes)
    frequency_hz, values = found.frequency_hz[lines], found.values[index, lines]
    _curve(axes, frequency_hz, values, color=_colour(point), linewidth=1.7, label="measured")
    fit = sheet.identification.fit
    if fit is not None:
        fitted = np.abs(fit[index, lines])
        _curve(axes, frequency_hz, fitted, color=style.INK, linewidth=0.6, label="fit of the modes")
    _room(axes, values)
    mark_modes(axes, sheet)
    axes.set_title(_name(point), fontsize=style.TINY + 1, color=style.INK, loc="right", pad=3)


def _curve(
    axes: Axes, frequency_hz: FloatArray, values: FloatArray, *, color: str, linewidth: float,
    label: str = "", linestyle: str = "-",
) -> None:  # fmt: skip
    places = envelope_places(values, _BINS)
    axes.plot(
        frequency_hz[places],
        values[places],
        color=color,
        linewidth=linewidth,
        linestyle=linestyle,
        label=label or None,
    )


def _room(axes: Axes, values: FloatArray) -> None:
    """From the floor of the curve to its top, with room above for the marks."""
    known = values[np.isfinite(values) & (values > 0)]
    if len(known):
        top, floor = 1.5 * float(known.max()), 0.5 * float(np.quantile(known, 0.02))
        axes.set_ylim(floor, top * (top / floor) ** (HEADROOM / (1 - HEADROOM)))


def _phase(axes: Axes, sheet: TestSheet, index: int) -> None:
    """Phase from -90 to 270 degrees, so that 0 and 180, between which it jumps, lie inside."""
    response = sheet.identification.frequency_response
    assert response is not None
    style.dress(axes, "", "phase (°)")
    lines = _lines(response.frequency_hz, axes)
    frequency_hz, colour = response.frequency_hz[lines], _colour(response.points[index])
    measured = response.accelerance[index, lines]
    # Of noise, phase fills the whole panel: the strongest line of each bin stands for it.
    places = peak_places(np.abs(measured), min(2 * _BINS, len(measured)))
    axes.plot(frequency_hz[places], _degrees(measured[places]), color=colour, linewidth=1.3)
    fit = sheet.identification.fit
    if fit is not None:
        fitted = _degrees(fit[index, lines][places])
        axes.plot(frequency_hz[places], fitted, color=style.INK, linewidth=0.6)
    axes.set_ylim(-95, 275)
    axes.set_yticks(_PHASE_TICKS)


def _degrees(values: ComplexArray) -> FloatArray:
    return np.asarray((np.degrees(np.angle(values)) + 90) % 360 - 90)


def _coherence(axes: Axes, sheet: TestSheet, shown: Sequence[int]) -> None:
    response = sheet.identification.frequency_response
    assert response is not None
    assert response.coherence is not None
    style.dress(axes, "", "coherence")
    lines = _lines(response.frequency_hz, axes)
    seen: list[str] = []
    for index in shown:
        colour = _colour(response.points[index])
        style_of_line = "--" if colour in seen else "-"
        seen.append(colour)
        _curve(
            axes, response.frequency_hz[lines], response.coherence[index, lines],
            color=colour, linewidth=0.7, linestyle=style_of_line,
        )  # fmt: skip
    axes.set_ylim(0, 1.05)


def _colour(point: ResponsePoint) -> str:
    return style.PLANE_COLOURS[point.plane] if point.plane else style.PURPLE


def _short(quantity: str) -> str:
    return quantity.replace(" (", "\n(", 1)


def _name(point: ResponsePoint) -> str:
    return words.place(point.name, point.plane, point.x_m)


def _caption(sheet: TestSheet) -> str:
    found = spectrum(sheet)
    assert found is not None
    some = words.some(min(_MOST_POINTS, len(found.points)), len(found.points), "measured points")
    if sheet.identification.frequency_response is None:
        return f"Power spectral density of the accelerations; nobody hit. {_MARKS}{some}"
    response = sheet.identification.frequency_response
    below = (
        "Below, coherence: 1 where the force explains the response, dashed at the second point of "
        "a plane. "
        if response.coherence is not None
        else "The coherence is not known. "
    )
    fit = (
        "the fit made of the identified modes is the thin dark line. "
        if sheet.identification.fit is not None
        else "no fit is at hand. "
    )
    return f"Acceleration per force at each point, magnitude and phase; {fit}{below}{_MARKS}{some}"


_MARKS = "Marks and lines: modes by plane, with their order where there is room."


def _alt(sheet: TestSheet) -> str:
    modes = sorted(sheet.modes, key=lambda mode: mode.frequency_hz)
    listed = ", ".join(f"{m.plane} {m.order} at {m.frequency_hz:.2f} Hz" for m in modes)
    kind = "Frequency response"
    if sheet.identification.frequency_response is None:
        kind = "Power spectral density"
    return f"{kind} with {len(modes)} identified modes: {listed}."


FIGURE = Member("response", "Response and modes", _draw, _caption, _alt)
