"""Errors that every test of a hanger has alike and that physics says the shape of.

The accelerometer's own mass lowers each mode by where it sits, both planes alike; supports give way
sideways and lower high orders of stiff bars. Both are small, known to first order and of uncertain
size, so that their mean shifts a prediction and what is uncertain is a few normal errors ("loads":
what one standard deviation of each does). The remaining errors of a mode are tau's
(`shm.inference.field`).
"""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray, Hanger, IntArray

_SENSOR_KG, _SENSOR_SD_KG = 0.05, 0.02
"""Piezo-electric and MEMS accelerometers for structures with magnet, base and cable end: 20 to 90 g
(makers' data sheets)."""

_REACH_M = (0.8, 2.5)
"""From the deck, where a person mounts a sensor; never beyond the middle of the hanger."""

_GIVE_M_N, _GIVE_SD_M_N = 4e-9, 4e-9
"""Of both supports of a plane together: gussets and chords of 1e8 to 1e9 N/m a side."""

_ALIKE = 0.5
"""Of the variance of the supports' give, what both planes share."""

_PLACES = 64
_LEAST_SHARE = 1e-3


def systematic_errors(
    hanger: Hanger,
    plane: IntArray,
    order: IntArray,
    frequency_hz: FloatArray,
    places_m: tuple[float, ...] = (),
) -> tuple[FloatArray, FloatArray]:
    """The mean (F,) and the loads (F, k) of ln(measured / bare bar's) frequencies.

    `plane` and `order` (from 1) are (F,). A mass M at x lowers a mode by (M / m L) sin^2(n pi x/L)
    (Rayleigh); supports of compliance C together by 4 C m L f^2/n^2, their reaction being
    m w^2 / q of the amplitude. `places_m` are the sensors' where they are known.
    """
    sensor_mean, sensor = _sensors(hanger, order, places_m)
    lowered = 4 * hanger.mass_per_length_kg_m * hanger.length_m * (frequency_hz / order) ** 2
    common = np.sqrt(_ALIKE) * np.ones(len(plane))
    own = np.sqrt(1 - _ALIKE) * (plane[:, None] == np.unique(plane))
    give = -_GIVE_SD_M_N * lowered[:, None] * np.column_stack([common, own])
    return sensor_mean - _GIVE_M_N * lowered, np.hstack([sensor, give])


def _sensors(
    hanger: Hanger, order: IntArray, places_m: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Mean (F,) and loads (F, k) of the sensors' mass."""
    ratio = 1 / (hanger.mass_per_length_kg_m * hanger.length_m)
    if places_m:
        x_m = np.array(places_m)
        felt = -ratio * np.sin(np.pi * np.outer(order, x_m / hanger.length_m)) ** 2
        return _SENSOR_KG * felt.sum(axis=1), np.asarray(_SENSOR_SD_KG * felt)
    low, high = np.minimum(_REACH_M, np.array([0.1, 0.5]) * hanger.length_m)
    x_m = low + (high - low) * (np.arange(_PLACES) + 0.5) / _PLACES
    felt = -ratio * np.sin(np.pi * np.outer(order, x_m / hanger.length_m)) ** 2
    mean = _SENSOR_KG * felt.mean(axis=1)
    square = (_SENSOR_KG**2 + _SENSOR_SD_KG**2) * felt @ felt.T / _PLACES
    variance, ways = np.linalg.eigh(square - np.outer(mean, mean))
    kept = variance > _LEAST_SHARE * variance.max()
    return mean, np.asarray(ways[:, kept] * np.sqrt(variance[kept]))
