"""Stabilisation diagram: poles over model order, the spectrum behind, what was chosen."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.sheet.content import TestSheet
from shm.report.sheet.figures.marks import HEADROOM, mark_modes
from shm.report.sheet.spectra import shown_range, spectrum
from shm.report.sheet.thinning import envelope_places

_BINS = 550


def _draw(sheet: TestSheet) -> Figure | None:
    poles = sheet.identification.poles
    if not len(poles.order):
        return None
    figure = style.new_figure(4.2)
    axes = figure.subplots()
    low, high = shown_range(sheet)
    axes.set_xlim(low, high)
    highest, lowest = float(poles.order.max()), float(poles.order.min())
    span = max(highest - lowest, 2.0)
    bottom = lowest - 0.03 * span
    axes.set_ylim(bottom, highest + (highest - bottom) * HEADROOM / (1 - HEADROOM) + 0.02 * span)
    style.dress(axes, "frequency (Hz)", "model order")
    axes.set_yticks([tick for tick in axes.get_yticks() if bottom <= tick <= highest])
    _background(axes, sheet)
    _poles(axes, sheet)
    mark_modes(axes, sheet)
    style.legend_of_figure(figure, [axes], columns=3)
    return figure


def _poles(axes: Axes, sheet: TestSheet) -> None:
    poles = sheet.identification.poles
    dropped = ~poles.stable
    axes.plot(
        poles.frequency_hz[dropped], poles.order[dropped], linestyle="none", marker="x",
        markersize=3.0, markeredgewidth=0.7, color=style.QUIET, label="dropped pole",
    )  # fmt: skip
    axes.plot(
        poles.frequency_hz[poles.stable], poles.order[poles.stable], linestyle="none",
        marker="o", markersize=2.8, color=style.GREEN, label="stable pole",
    )  # fmt: skip


def _background(axes: Axes, sheet: TestSheet) -> None:
    """The spectrum over all points on a logarithmic axis of its own, without numbers."""
    found = spectrum(sheet)
    if found is None:
        return
    behind = axes.twinx()
    behind.set_zorder(axes.get_zorder() - 1)
    axes.patch.set_visible(False)
    low, high = axes.get_xlim()
    start, stop = np.searchsorted(found.frequency_hz, [low, high])
    lines = slice(max(1, int(start)), int(stop) + 1)
    values = found.together[lines]
    places = envelope_places(values, _BINS)
    label = "spectrum of all points (log scale)"
    behind.semilogy(
        found.frequency_hz[lines][places], values[places], color=style.QUIET, linewidth=0.8,
        alpha=0.6,
    )  # fmt: skip
    axes.plot([], [], color=style.QUIET, linewidth=0.8, alpha=0.6, label=label)
    behind.set_axis_off()
    known = values[np.isfinite(values) & (values > 0)]
    if len(known):
        bottom, top = float(np.quantile(known, 0.01)) / 2, float(known.max())
        behind.set_ylim(bottom, top * (top / bottom) ** (HEADROOM / (1 - HEADROOM)))


def _caption(sheet: TestSheet) -> str:
    poles = sheet.identification.poles
    stable = int(np.sum(poles.stable))
    return (
        f"{len(poles.order)} poles over the order of the model that gave them, {stable} of them "
        "stable; a column of stable poles is a mode. Marks on top: the chosen modes by plane, and "
        "what was set aside."
    )


def _alt(sheet: TestSheet) -> str:
    listed = ", ".join(f"{m.plane} {m.order} at {m.frequency_hz:.2f} Hz" for m in sheet.modes)
    return f"Stabilisation diagram with {len(sheet.modes)} chosen modes: {listed}."


FIGURE = Member("stabilisation", "Stabilisation diagram", _draw, _caption, _alt)
