"""Stabilisation diagram: poles over model order, the spectrum behind, what was chosen."""

from __future__ import annotations

import numpy as np

from shm.report.figures.illustration import Member
from shm.report.figures.modal_test_spectra import (
    Shown,
    Spectrum,
    mode_marks,
    shown_range,
    with_headroom,
)
from shm.report.figures.specification import (
    Axis,
    Line,
    Mark,
    Panel,
    Points,
    Specification,
    Symbol,
    envelope_places,
    stacked,
)
from shm.values import BoolArray

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
