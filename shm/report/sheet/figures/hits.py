"""The hits laid over each other: pulse, force spectrum, ring-down."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from shm.report import words
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.sheet.blows import (
    CURVE_BINS,
    LOWEST_DB,
    REACH_DB,
    Blow,
    blow_name,
    shown_blows,
)
from shm.report.sheet.content import TestSheet
from shm.report.sheet.spectra import searched_range
from shm.report.sheet.thinning import envelope_places

_COLOURS = (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE)
_DASHES = ("-", "--", ":")
_DROPPED_DASHES = ((4, 1.5), (1, 1), (6, 1, 1, 1), (2, 2))


def _draw(sheet: TestSheet) -> Figure | None:
    shown = shown_blows(sheet)
    if not shown:
        return None
    figure = style.new_figure(5.4)
    panels = figure.subplot_mosaic([["pulse", "spectrum"], ["fade", "fade"]])
    _pulses(panels["pulse"], shown)
    _spectra(panels["spectrum"], sheet, shown)
    _fades(panels["fade"], shown)
    columns = 6 if all(blow.hit.used for blow in shown) else 3
    style.legend_of_figure(figure, [panels["pulse"]], columns)
    return figure


def _line(blow: Blow, place: int) -> dict[str, Any]:
    """Colour and dashes of a hit: a dropped one is red."""
    if not blow.hit.used:
        dashes = _DROPPED_DASHES[place % len(_DROPPED_DASHES)]
        return {"color": style.RED, "linestyle": (0, dashes), "linewidth": 1.1}
    dashed = _DASHES[place // len(_COLOURS) % len(_DASHES)]
    return {"color": _COLOURS[place % len(_COLOURS)], "linestyle": dashed, "linewidth": 0.9}


def _pulses(axes: Axes, shown: list[Blow]) -> None:
    style.dress(axes, "time from the start of the hit (ms)", "force (N)")
    spans = np.array([blow.near_s for blow in shown])
    axes.set_xlim(1e3 * spans[:, 0].min(), 1e3 * spans[:, 1].max())
    for place, blow in enumerate(shown):
        places = envelope_places(blow.force_n, CURVE_BINS)
        axes.plot(
            1e3 * blow.time_s[places],
            blow.force_n[places],
            label=blow_name(blow),
            **_line(blow, place),
        )


def _spectra(axes: Axes, sheet: TestSheet, shown: list[Blow]) -> None:
    style.dress(axes, "frequency (Hz)", "force, relative (dB)")
    highest = float(shown[0].spectrum_hz[-1])
    low, high = searched_range(sheet)
    high = min(high, highest)
    end = min(2 * high, highest)
    for place, blow in enumerate(shown):
        lines = blow.spectrum_hz <= end
        spectrum_hz, spectrum_db = blow.spectrum_hz[lines], blow.spectrum_db[lines]
        places = envelope_places(spectrum_db, CURVE_BINS)
        axes.plot(spectrum_hz[places], spectrum_db[places], **_line(blow, place))
    axes.axhline(REACH_DB, color=style.INK, linewidth=0.8, linestyle="-.")
    axes.text(
        0.01, REACH_DB - 0.6, "a tenth of the force", transform=axes.get_yaxis_transform(),
        va="top", fontsize=style.TINY, color=style.INK,
    )  # fmt: skip
    axes.axvspan(low, high, color=style.GREEN, alpha=0.10, linewidth=0)
    axes.set_ylim(LOWEST_DB, 2)
    axes.set_xlim(0, end)
    band = "band" if sheet.band_hz else "where modes were found"
    axes.set_title(
        f"shaded: {band}", fontsize=style.TINY + 0.5, color=style.INK, loc="right", pad=2
    )


def _fades(axes: Axes, shown: list[Blow]) -> None:
    style.dress(
        axes, "time from the start of the hit (s)", "largest acceleration\nper peak force (m/s²/N)"
    )
    axes.set_yscale("log")
    axes.yaxis.set_minor_formatter(NullFormatter())
    for place, blow in enumerate(shown):
        axes.plot(blow.fade_s, blow.fade_m_s2_n, **_line(blow, place))
    axes.set_xlim(0, max(float(blow.fade_s[-1]) for blow in shown))


def _caption(sheet: TestSheet) -> str:
    some = words.some(len(shown_blows(sheet)), len(sheet.hits), "hits")
    return (
        "Above, the force of each hit and its spectrum, each relative to its largest value: it "
        "should stay above a tenth (-20 dB) up to the end of the band. Below, the largest "
        "acceleration of each short span after the hit, per peak force: sound hits lie over each "
        f"other.{some}"
    )


def _alt(sheet: TestSheet) -> str:
    shown = shown_blows(sheet)
    reaches = [b.reach_hz for b in shown if b.hit.used and np.isfinite(b.reach_hz)]
    forces = [blow.hit.peak_force_n for blow in shown]
    reach = f" A tenth of the force is left at {np.median(reaches):.0f} Hz." if reaches else ""
    return (
        f"{words.counted(len(shown), 'hit')} of {words.plain(min(forces))} to "
        f"{words.plain(max(forces))} N laid over each other.{reach}"
    )


FIGURE = Member("hits", "Hits: pulses, force spectra, ring-downs", _draw, _caption, _alt)
