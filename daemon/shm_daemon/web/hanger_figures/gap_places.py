"""Where along the hanger a local cause of the gap would have to sit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shm.report import words
from shm.report.diagnosis.figures.below_map import local
from shm.report.diagnosis.phrases import title
from shm.values import GapPlace
from shm_daemon.web.hanger_figures.by_mode import sheet_of
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

_LOOKS = (("purple", "solid"), ("green", "dash"), ("ink", "dashdot"), ("red", "dot"))
_FEW_PLACES = 4


def _draw(view: HangerView) -> dict[str, Any]:
    sheet = sheet_of(view)
    traces = [_profile(p, *look) for p, look in zip(local(sheet), _LOOKS, strict=False)]
    return figure(
        traces,
        "position from the deck end (m)",
        "density, largest 1",
        xaxis={"range": [-0.1, sheet.hanger.length_m + 0.1], "zeroline": False},
        yaxis={"range": [0, 1.08], "tickvals": [0, 0.5, 1]},
    )


def _profile(place: GapPlace, hue: str, dash: str) -> Trace:
    """A curve, or bars where the cause may only sit at a few places."""
    x_m, density = np.array(place.profile).T
    density = density / max(float(np.nanmax(density)), 1e-300)
    name = f"{title(place.kind)} ({_share(place)})"
    if len(x_m) <= _FEW_PLACES:
        return {
            "type": "bar", "x": x_m, "y": density, "width": 0.12, "name": name,
            "marker": {"color": colour(hue)},
        }  # fmt: skip
    return {
        "type": "scatter", "mode": "lines", "x": x_m, "y": density, "name": name,
        "line": {"color": colour(hue), "dash": dash, "width": 2}, "fill": "tozeroy",
        "fillcolor": colour(hue, 0.08), "hovertemplate": "%{x:.2f} m",
    }  # fmt: skip


def _share(place: GapPlace) -> str:
    known = math.isfinite(place.share)
    return f"{100 * place.share:.0f} % of the misfit" if known else "share not known"


def _caption(view: HangerView) -> str:
    return (
        "Where along the hanger a local cause of each kind would have to sit, were it of that "
        "kind, with the share of the misfit that it would explain there."
    )


def _alt(view: HangerView) -> str:
    places = "; ".join(
        f"as {title(place.kind)} it would sit at {words.number(place.x_m, '.2f')} m"
        for place in local(sheet_of(view))
    )
    return f"Along the hanger: {places}."


FIGURE = HangerFigure(
    "gap_places",
    "Where along the hanger",
    "gap",
    lambda view: view.sheet is not None and bool(local(view.sheet)),
    _draw,
    _caption,
    _alt,
    height_px=300,
)
