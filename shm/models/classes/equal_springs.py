"""The tension of a bar on two equal rotational springs, from several measured frequencies.

What the thesis (1.3) tells of Ceballos and Prato (2008, J. Sound Vib. 317, 127): two rotational
springs stand for all ends, their stiffness comes from the frequencies, then the axial force
follows. Their explicit expression was not at hand. Here the exact beam is fitted to all orders of a
plane by least squares; so it is their supposition that errs, never an approximation of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from shm.models.classes.tensioned_beam import wave_numbers
from shm.values import FloatArray

NAME = "equal springs"
SOURCE = "supposition of Ceballos and Prato 2008, J. Sound Vib. 317, 127; exact beam"
ENDS = "alike"
LEAVES_OUT = "ends that differ"

VALID_FROM_XI, WORST_ERROR = 3.0, 2e-4
"""On equal springs, of six orders, up to xi = 200, by `tests/models/test_equal_springs.py`."""

_HALF_WAY = 10.0  # k L/EI of a first mode half way from pinned to clamped: share 0.5 of a clamp
_MOST_XI_SQUARED = 1e8  # a string: xi = 10,000, where the ends shift a frequency by 0.02 %
_STARTS = (0.1, 0.5, 0.9)  # numerical: soft, middling and stiff ends
_FEWEST = 2  # two unknowns


def tension_n(
    frequency_hz: Mapping[int, float],
    length_m: float,
    mass_per_length_kg_m: float,
    bending_stiffness_n_m2: float,
) -> float:
    """Return the tension by frequencies of orders; NaN of fewer than two."""
    # Slow to import, and seldom needed.
    from scipy.optimize import least_squares

    orders = sorted(order for order, hz in frequency_hz.items() if math.isfinite(hz))
    if len(orders) < _FEWEST:
        return math.nan
    unit = math.sqrt(bending_stiffness_n_m2 / mass_per_length_kg_m) / (2 * math.pi * length_m**2)
    measured = np.log([frequency_hz[order] / unit for order in orders])
    places = np.array(orders) - 1

    def off(point: FloatArray) -> FloatArray:
        tension, spring = point[:1], _HALF_WAY * point[1:] / (1 - point[1:])
        q = wave_numbers(tension, spring, spring, orders[-1])[0, places]
        return np.asarray(np.log(q * np.sqrt(tension + q * q)) - measured)

    # As if pinned: f^2 is 1/4 n^2 pi^2 of xi^2 + n^2 pi^2 in these units.
    half_waves = (math.pi * orders[-1]) ** 2
    pinned = math.exp(2 * measured[-1]) / half_waves - half_waves
    start = float(np.clip(pinned, 1.0, _MOST_XI_SQUARED / 2))
    most = ([0.0, 0.0], [_MOST_XI_SQUARED, 1 - 1e-6])  # numerical: a clamp within 1e-7
    found = [
        least_squares(
            off, [start, share], bounds=most, x_scale="jac", method="dogbox", xtol=1e-12, ftol=1e-12
        )
        for share in _STARTS
    ]
    best = min(found, key=lambda each: float(each.cost))
    return float(best.x[0]) * bending_stiffness_n_m2 / length_m**2
