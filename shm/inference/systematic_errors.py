"""Errors that every test of a hanger has alike and that physics says the shape of.

The accelerometer's own mass lowers each mode by where it sits, both planes alike; supports give way
sideways and lower high orders of stiff bars; the section wanders. All are small, known to first
order and of uncertain size, so that their mean shifts a prediction and what is uncertain is a few
normal errors ("loads": what one standard deviation of each does). The remaining errors of a mode
are tau's (`shm.inference.field`).
"""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray, Hanger, IntArray

_SENSOR_KG, _SENSOR_SD_KG = 0.05, 0.02
"""Piezo-electric and MEMS accelerometers for structures with magnet, base and cable end: 20 to 90 g
(makers' data sheets)."""

_MOST_OF_BAR = 0.03
"""Of the bar's own mass: what is lighter than that is measured without touching it."""

_REACH_M = (0.8, 2.5)
"""From the deck, where a person mounts a sensor; never beyond the middle of the hanger."""

_GIVE_M_N, _GIVE_SD_M_N = 4e-9, 4e-9
"""Of both supports of a plane together: gussets and chords of 1e8 to 1e9 N/m a side."""

_ALIKE = 0.5
"""Of the variance of the supports' give, what both planes share."""

_SECTION_REACH_M = 1.0
"""Over which a rolled section goes together; a fifth of a short bar."""

_PLACES, _FEW_PLACES = 64, 5
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
    section = _section(hanger, order)
    lowered = _lowered(hanger, order, frequency_hz)
    give = -_GIVE_SD_M_N * lowered[:, None] * _by_plane(plane)
    return sensor_mean - _GIVE_M_N * lowered, np.hstack([sensor, give, section])


def shared_loads(
    hanger: Hanger, plane: IntArray, order: IntArray, frequency_hz: FloatArray
) -> FloatArray:
    """Loads (F, k) of sensors and supports alone, about no such error, k whatever the data are.

    For a hypothesis among whose rivals a heavy sensor or a support that gives way are: the mean is
    theirs to claim.
    """
    felt = _felt(hanger, order, _within_reach_m(hanger, _FEW_PLACES))
    sensor = np.hypot(_SENSOR_KG, _SENSOR_SD_KG) / np.sqrt(_FEW_PLACES) * felt
    size = np.hypot(_GIVE_M_N, _GIVE_SD_M_N) * _lowered(hanger, order, frequency_hz)
    return np.hstack([sensor, -size[:, None] * _by_plane(plane)])


def _felt(hanger: Hanger, order: IntArray, x_m: FloatArray) -> FloatArray:
    """What a kilogram at each place does to ln of each frequency (F, places).

    Less where a usual sensor would be more than its share of a light bar.
    """
    mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
    ratio = min(1.0, _MOST_OF_BAR * mass_kg / _SENSOR_KG) / mass_kg
    return np.asarray(-ratio * np.sin(np.pi * np.outer(order, x_m / hanger.length_m)) ** 2)


def _within_reach_m(hanger: Hanger, count: int) -> FloatArray:
    """Places (count,) spread evenly over where a sensor may be."""
    low, high = np.minimum(_REACH_M, np.array([0.1, 0.5]) * hanger.length_m)
    return np.asarray(low + (high - low) * (np.arange(count) + 0.5) / count)


def _lowered(hanger: Hanger, order: IntArray, frequency_hz: FloatArray) -> FloatArray:
    """By which part a frequency falls per m/N that the supports of its plane give way."""
    mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
    return np.asarray(4 * mass_kg * (frequency_hz / order) ** 2)


def _by_plane(plane: IntArray) -> FloatArray:
    """Shares (F, 3) of what the planes have in common and each for itself."""
    own = np.sqrt(1 - _ALIKE) * (plane[:, None] == np.arange(2))
    return np.column_stack([np.sqrt(_ALIKE) * np.ones(len(plane)), own])


def _section(hanger: Hanger, order: IntArray) -> FloatArray:
    """Loads (F, orders) of a section that wanders along the bar about its mean.

    Of an area 1 + a(x), mode n changes by half of the mean of a(x) cos(2 n pi x/L) in a string, by
    up to 1.5 times it between clamped ends, and is taken to change by once it; the variance of the
    mean over a with correlation exp(-(s/r)^2 / 2) is
    sd^2 sqrt(2 pi) (r/L) exp(-(2 n pi r/L)^2 / 2) / 2. Both planes have it alike.
    """
    reach = min(_SECTION_REACH_M / hanger.length_m, 0.2)
    distinct = np.unique(order)
    variance = np.sqrt(2 * np.pi) * reach * np.exp(-((2 * np.pi * distinct * reach) ** 2) / 2)
    size = hanger.scatter.along * np.sqrt(variance / 2)
    kept = size > _LEAST_SHARE * hanger.scatter.along
    return np.asarray((order[:, None] == distinct[kept]) * size[kept])


def _sensors(
    hanger: Hanger, order: IntArray, places_m: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Mean (F,) and loads (F, k) of the sensors' mass."""
    if places_m:
        felt = _felt(hanger, order, np.array(places_m))
        return _SENSOR_KG * felt.sum(axis=1), np.asarray(_SENSOR_SD_KG * felt)
    felt = _felt(hanger, order, _within_reach_m(hanger, _PLACES))
    mean = _SENSOR_KG * felt.mean(axis=1)
    square = (_SENSOR_KG**2 + _SENSOR_SD_KG**2) * felt @ felt.T / _PLACES
    variance, ways = np.linalg.eigh(square - np.outer(mean, mean))
    kept = variance > _LEAST_SHARE * variance.max()
    return mean, np.asarray(ways[:, kept] * np.sqrt(variance[kept]))
