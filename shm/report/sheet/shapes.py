"""Which mode shapes a figure shows, how far it reaches, and the thin line that guides the eye."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shm.report.contents import TestSheet
from shm.values import FloatArray, Mode

ROOM = 1.35
"""To either side of a shape, whose largest value is 1."""
_MOST = 36
_LEAST_POINTS = 2
_NEAR = 0.4
"""A string misses the points by no more than this share of them where it is drawn."""


@dataclass(frozen=True, eq=False)
class Guide:
    """A line through a shape: places (n,) from the deck end in m, values (n,)."""

    x_m: FloatArray
    value: FloatArray


def shown_modes(sheet: TestSheet) -> list[Mode]:
    """Those with a shape, as many as there is room for."""
    return modes_with_shape(sheet)[:_MOST]


def modes_with_shape(sheet: TestSheet) -> list[Mode]:
    """Modes measured at so many places or directions that there is a shape to see."""
    return [mode for mode in sheet.modes if _known_values(mode) >= _LEAST_POINTS]


def _known_values(mode: Mode) -> int:
    values = [value for p in mode.shape if math.isfinite(p.x_m) for value in (p.value, p.cross)]
    return sum(math.isfinite(value) for value in values)


def extent_m(sheet: TestSheet) -> tuple[float, float]:
    """From end to end of the hanger, or of the measured places where its length is not known."""
    if sheet.hanger is not None:
        return 0.0, sheet.hanger.length_m
    places = [p.x_m for mode in sheet.modes for p in mode.shape if math.isfinite(p.x_m)]
    low, high = min(places), max(places)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def panel_title(mode: Mode) -> str:
    """`2: 13.85 Hz`."""
    return f"{mode.order}: {mode.frequency_hz:.4g} Hz"


def guide_name(sheet: TestSheet) -> str:
    """What the guides of a test are, for a legend."""
    return "places joined" if sheet.hanger is None else "guide: taut string"


def guide(sheet: TestSheet, mode: Mode) -> Guide | None:
    """A taut string's shape of the mode's order in the measured size, None where it does not come
    near the points; straight lines between the places where the hanger is not described."""
    known = [p for p in mode.shape if math.isfinite(p.x_m) and math.isfinite(p.value)]
    pairs = sorted((p.x_m, p.value) for p in known)
    x_m, value = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
    if sheet.hanger is None:
        return Guide(x_m, value)
    wave = mode.order * np.pi / sheet.hanger.length_m
    string = np.sin(wave * x_m)
    size = float(string @ value) / max(float(string @ string), 1e-9)
    misses = float(np.linalg.norm(value - size * string))
    if len(x_m) < _LEAST_POINTS or misses >= _NEAR * np.linalg.norm(value) or abs(size) >= ROOM:
        return None
    places = np.linspace(0, sheet.hanger.length_m, 12 * mode.order + 1)
    return Guide(places, size * np.sin(wave * places))
