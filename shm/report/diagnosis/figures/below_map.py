"""Below the gap map: where a local cause would sit, and which conditions the gap goes with."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from shm.report.content import NORMAL_90
from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.phrases import title
from shm.report.figures import style
from shm.values import GapPlace, Trend

CLEAR_SD = 2.0
"""Standard deviations beyond which a gap or a trend is drawn as clear."""
_FEW_PLACES = 4
_PLACE_COLOURS = (style.PURPLE, style.GREEN, style.INK, style.RED)
_DASHES = ("-", "--", "-.", ":")


def local(sheet: DiagnosisSheet) -> list[GapPlace]:
    """Places with a profile, those that explain most first."""
    found = [place for place in sheet.diagnosis.places if len(place.profile) > 1]
    return sorted(found, key=lambda place: -place.share)[: len(_DASHES)]


def profiles(axes: Axes, sheet: DiagnosisSheet) -> None:
    """The density of the place along the hanger of each kind of local cause, largest 1."""
    style.dress(axes, "position from the deck end (m)", "density, largest 1")
    for place, colour, dashes in zip(local(sheet), _PLACE_COLOURS, _DASHES, strict=False):
        _profile(axes, place, colour, dashes)
    axes.set_xlim(0, sheet.hanger.length_m)
    axes.set_ylim(0, 1.08)
    axes.set_yticks((0, 0.5, 1))
    style.legend_above(axes, columns=2)


def _profile(axes: Axes, place: GapPlace, colour: str, dashes: str) -> None:
    """One kind of cause as a curve, or as bars where it may only sit at a few places."""
    x_m, density = np.array(place.profile).T
    density = density / max(float(np.nanmax(density)), 1e-300)
    told = f"{title(place.kind)} ({_share(place)})"
    if len(x_m) <= _FEW_PLACES:
        axes.vlines(x_m, 0, density, color=colour, linewidth=4, label=told, clip_on=False)
        return
    axes.plot(x_m, density, color=colour, linestyle=dashes, linewidth=1.4, label=told)
    axes.fill_between(x_m, 0, density, color=colour, alpha=0.1, linewidth=0)
    if math.isfinite(place.x_m):
        axes.plot([place.x_m], [0], marker="^", color=colour, markersize=6, clip_on=False)


def _share(place: GapPlace) -> str:
    return f"{100 * place.share:.0f} %" if math.isfinite(place.share) else "share not known"


def known(sheet: DiagnosisSheet) -> list[Trend]:
    return [trend for trend in sheet.diagnosis.trends if math.isfinite(trend.slope_percent)]


def goes_with(axes: Axes, sheet: DiagnosisSheet) -> None:
    """How the mean residual changes over the range of each condition."""
    style.dress(axes, "change over its range (%)", "")
    found = known(sheet)
    axes.axvline(0, color=style.INK, linewidth=0.8)
    for row, trend in enumerate(found):
        clear = abs(trend.slope_percent) >= CLEAR_SD * trend.slope_sd_percent
        axes.errorbar(
            [trend.slope_percent], [row], xerr=NORMAL_90 * np.nan_to_num(trend.slope_sd_percent),
            marker="D", markersize=4.5, capsize=2.5, elinewidth=1.0, color=style.INK,
            markerfacecolor=style.INK if clear else "none",
        )  # fmt: skip
    axes.set_yticks(range(len(found)), [trend.condition for trend in found])
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    axes.set_ylim(len(found) - 0.4, -0.6)
    axes.set_title("goes with", fontsize=9, color=style.INK, loc="left")
