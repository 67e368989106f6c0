"""The hits laid over each other: pulse, force spectrum, ring-down."""

from __future__ import annotations

from typing import Any

import numpy as np

from shm.report import TestSheet
from shm.report.sheet.blows import (
    CURVE_BINS,
    LOWEST_DB,
    REACH_DB,
    Blow,
    blow_name,
    shown_blows,
)
from shm.report.sheet.figures.hits import FIGURE as PRINTED
from shm.report.sheet.spectra import searched_range
from shm.report.sheet.thinning import envelope_places
from shm.values import FloatArray
from shm_daemon.web import plotting
from shm_daemon.web.figures_of_test.contract import Shown, TestFigure
from shm_daemon.web.figures_of_test.panels import Panel, apart, drawn, escaped, log_axis, numbers

_COLOURS = ("blue", "orange", "green", "purple")
_DASHES = ("solid", "dash", "dot")
_FADE_ROOM = 1.3


def _draw(shown: Shown) -> dict[str, Any] | None:
    hits = shown_blows(shown.sheet)
    if not hits:
        return None
    band_hz = _band_hz(shown.sheet, hits)
    layout = apart([_pulse_panel(hits), _spectrum_panel(band_hz, hits), _fade_panel(hits)])
    layout["shapes"] = _guides(band_hz)
    traces = [trace for place, blow in enumerate(hits) for trace in _traces(blow, place)]
    return drawn(traces, layout)


def _band_hz(sheet: TestSheet, hits: list[Blow]) -> tuple[float, float]:
    low, high = searched_range(sheet)
    return low, min(high, float(hits[0].spectrum_hz[-1]))


def _pulse_panel(hits: list[Blow]) -> Panel:
    spans = np.array([blow.near_s for blow in hits])
    wide = {"range": [1e3 * float(spans[:, 0].min()), 1e3 * float(spans[:, 1].max())]}
    return Panel("force (N)", x_label="time from the start of the hit (ms)", x=wide)


def _spectrum_panel(band_hz: tuple[float, float], hits: list[Blow]) -> Panel:
    end = min(2 * band_hz[1], float(hits[0].spectrum_hz[-1]))
    return Panel(
        "force, relative (dB)", y={"range": [LOWEST_DB, 2]}, x_label="frequency (Hz)",
        x={"range": [0, end]}, title="shaded: band; line: a tenth of the force",
    )  # fmt: skip


def _fade_panel(hits: list[Blow]) -> Panel:
    end_s = max(float(blow.fade_s[-1]) for blow in hits)
    values = np.concatenate([blow.fade_m_s2_n for blow in hits])
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.1, 1.0)
    return Panel(
        "m/s² per N", y=log_axis(low / _FADE_ROOM, high * _FADE_ROOM),
        x_label="time from the start of the hit (s)", x={"range": [0, end_s]},
        title="largest acceleration per peak force",
    )  # fmt: skip


def _traces(blow: Blow, place: int) -> list[dict[str, Any]]:
    """A hit in every panel under one name; a dropped one is red."""
    named = {"name": escaped(blow_name(blow)), "legendgroup": f"hit {blow.number}"}
    line = _line(blow, place)
    pulses = envelope_places(blow.force_n, CURVE_BINS)
    reach = blow.spectrum_db > LOWEST_DB - 20
    hz, db = blow.spectrum_hz, np.where(reach, blow.spectrum_db, np.nan)
    spectra = envelope_places(db, CURVE_BINS)
    curves: tuple[tuple[FloatArray, FloatArray], ...] = (
        (1e3 * blow.time_s[pulses], blow.force_n[pulses]),
        (hz[spectra], db[spectra]),
        (blow.fade_s, blow.fade_m_s2_n),
    )
    return [
        {
            "type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y), "line": line,
            "xaxis": f"x{number}".removesuffix("1"), "yaxis": f"y{number}".removesuffix("1"),
            "showlegend": number == 1, **named,
        }
        for number, (x, y) in enumerate(curves, 1)
    ]  # fmt: skip


def _line(blow: Blow, place: int) -> dict[str, Any]:
    if not blow.hit.used:
        dash = ("dash", "dot", "dashdot", "longdash")[place % 4]
        return {"color": plotting.colour("red"), "width": 1.6, "dash": dash}
    dash = _DASHES[place // len(_COLOURS) % len(_DASHES)]
    colour = plotting.colour(_COLOURS[place % len(_COLOURS)])
    return {"color": colour, "width": 1.2, "dash": dash}


def _guides(band_hz: tuple[float, float]) -> list[dict[str, Any]]:
    """The band, and the level that the force should keep up to its end."""
    band = {
        "type": "rect", "xref": "x2", "yref": "y2 domain", "x0": band_hz[0], "x1": band_hz[1],
        "y0": 0, "y1": 1, "fillcolor": plotting.colour("green"), "opacity": 0.12, "layer": "below",
        "line": {"width": 0},
    }  # fmt: skip
    level = {
        "type": "line", "xref": "x2 domain", "yref": "y2", "x0": 0, "x1": 1, "y0": REACH_DB,
        "y1": REACH_DB, "line": {"color": plotting.colour("ink"), "width": 1, "dash": "dashdot"},
    }  # fmt: skip
    return [band, level]


FIGURE = TestFigure(
    "hits", PRINTED.title, "file", _draw, lambda shown: PRINTED.caption(shown.sheet),
    lambda shown: PRINTED.alt(shown.sheet), height_px=lambda sheet: 760,
)  # fmt: skip
