"""Below the gap map: where a local cause would sit, and which conditions the gap goes with."""

from __future__ import annotations

import math

import numpy as np

from shm.report.content import NORMAL_90
from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.phrases import title
from shm.report.figures.specification import (
    Axis,
    Band,
    Bars,
    Dash,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
)
from shm.values import GapPlace, Trend

CLEAR_SD = 2.0
"""Standard deviations beyond which a gap or a trend is drawn as clear."""
_FEW_PLACES = 4
_LOOKS: tuple[tuple[str, Dash], ...] = (
    ("purple", "solid"),
    ("green", "dash"),
    ("ink", "dashdot"),
    ("red", "dot"),
)


def local(sheet: DiagnosisSheet) -> list[GapPlace]:
    """Places with a profile, those that explain most first."""
    found = [place for place in sheet.diagnosis.places if len(place.profile) > 1]
    return sorted(found, key=lambda place: -place.share)[: len(_LOOKS)]


def profiles(sheet: DiagnosisSheet) -> Panel:
    """The density of the place along the hanger of each kind of local cause, largest 1."""
    looks = zip(local(sheet), _LOOKS, strict=False)
    return Panel(
        y=Axis(label="density, largest 1", range=(0, 1.08), ticks=(0, 0.5, 1)),
        marks=[mark for place, look in looks for mark in _profile(place, *look)],
        x=Axis(label="position from the deck end (m)", range=(0, sheet.hanger.length_m)),
        width=1.6, has_own_legend=True,
    )  # fmt: skip


def _profile(place: GapPlace, colour: str, dash: Dash) -> list[Mark]:
    """One kind of cause as a curve, or as bars where it may only sit at a few places."""
    x_m, density = np.array(place.profile).T
    density = density / max(float(np.nanmax(density)), 1e-300)
    name, hover = f"{title(place.kind)} ({_share(place)})", "%{x:.2f} m"
    if len(x_m) <= _FEW_PLACES:
        return [Bars(x=x_m, y=density, width=0.12, colour=colour, name=name, hover=hover)]
    found: list[Mark] = [
        Band(x=x_m, low=np.zeros(len(x_m)), high=density, colour=colour, opacity=0.1),
        Line(x=x_m, y=density, colour=colour, dash=dash, width=1.4, name=name, hover=hover),
    ]
    if math.isfinite(place.x_m):
        at = Points(x=[place.x_m], y=[0], symbol="triangle", size=6, colour=colour, hover=hover)
        found.append(at)
    return found


def _share(place: GapPlace) -> str:
    return f"{100 * place.share:.0f} %" if math.isfinite(place.share) else "share not known"


def known(sheet: DiagnosisSheet) -> list[Trend]:
    return [trend for trend in sheet.diagnosis.trends if math.isfinite(trend.slope_percent)]


def goes_with(sheet: DiagnosisSheet) -> Panel:
    """How the mean residual changes over the range of each condition."""
    found = known(sheet)
    rows = np.arange(len(found))
    slope = np.array([trend.slope_percent for trend in found])
    sd = np.nan_to_num([trend.slope_sd_percent for trend in found])
    clear = np.abs(slope) >= CLEAR_SD * np.array([trend.slope_sd_percent for trend in found])
    ends = np.column_stack([slope - NORMAL_90 * sd, slope + NORMAL_90 * sd, [np.nan] * len(found)])
    marks: list[Mark] = [Rule(at=0, axis="x", width=0.8), Line(x=ends.ravel(), y=rows.repeat(3))]
    for chosen, filled in ((clear, True), (~clear, False)):
        look = {"symbol": "diamond", "filled": filled}
        marks.append(Points(x=slope[chosen], y=rows[chosen], **look))  # type: ignore[arg-type]
    return Panel(
        y=Axis(
            range=(len(found) - 0.4, -0.6), ticks=rows.tolist(), grid=False,
            tick_labels=[trend.condition for trend in found],
        ),
        marks=marks, x=Axis(label="change over its range (%)"), title="goes with",
        title_side="left",
    )  # fmt: skip
