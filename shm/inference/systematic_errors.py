"""Errors that every test of a hanger has alike and that physics says the shape of.

The accelerometer's own mass lowers each mode by where it sits, both planes alike; the section
wanders; supports give way sideways and lower high orders of stiff bars; fittings stiffen the ends
(`shm.models.end_effects`). All are small, known to first order and of uncertain size, so that their
mean shifts a prediction and what is uncertain is a few normal errors ("loads": what one standard
deviation of each does). The remaining errors of a mode are tau's (`shm.inference.field`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from shm.models.end_effects import EndWaves
from shm.values import FloatArray, Hanger, IntArray

Ends: TypeAlias = tuple[EndWaves, EndWaves]
"""The deck's and the arch's."""

_SENSOR_KG, _SENSOR_SD_KG = 0.05, 0.05
"""Accelerometers for structures with magnet, base and cable end: 20 to 90 g, seismic ones
more (makers' data sheets); none where a laser looks on."""

_MOST_OF_BAR = 0.03
"""Of the bar's own mass: what is lighter than that is measured without touching it."""

_REACH_M = (0.8, 2.5)
"""From the deck, where a person mounts a sensor; never beyond the middle of the hanger."""

_GIVE_M_N, _GIVE_SD_M_N = 3.5e-9, 4e-9
"""Of one support: gussets and chords of 1e8 to 1e9 N/m, or next to nothing."""

_ALIKE = 0.5
"""Of the variance of an end's details, what both planes share: a fork or a gusset has two faces."""

_RIGID, _RIGID_SD = 0.6, 0.3
"""Of the effect of a fitting without curvature: a thread in a nut has a fifth of it, a socket or a
fork nearly all."""

_HEAVIER, _HEAVIER_SD = 0.7, 0.6
"""Mass of a fitting beyond the bar's over its length, as a share of that: threads to sockets."""

_SECOND_ORDER = 0.1
"""Of the mean effect of an end's detail, by which the first order is wrong for each mode (as
against exact solutions: 0.03 in the middle, 0.2 at the worst)."""

_SECTION_REACH_M = 1.0
"""Over which a rolled section goes together; a fifth of a short bar."""

# Numerical: 64 places within a person's reach are a tenth of a half wave apart at order 15; 5,
# which make as many loads whatever the data, are two a half wave at order 6.
_PLACES, _FEW_PLACES = 64, 5

# Numerical: left out is a thousandth of the section's scatter, or of the sensors' largest variance.
_LEAST_SHARE = 1e-3


def mean_of_ends(ends: Ends, fittings_m: tuple[float, float]) -> FloatArray:
    """What the supports and fittings of both ends do on average to ln of frequencies (n, F)."""
    found = _GIVE_M_N * (ends[0].give() + ends[1].give())
    for end, fitting_m in zip(ends, fittings_m, strict=True):
        if fitting_m:
            stiffened, weighed = end.fitting(fitting_m)
            found = found + _RIGID * stiffened + _HEAVIER * weighed
    return np.asarray(found)


def loads_of_ends(
    ends: Ends, fittings_m: tuple[float, float], plane: IntArray, order: IntArray
) -> FloatArray:
    """Loads (F, k) of the same, of one parameter set: each end by itself, and what the first order
    leaves of each mode.
    """
    shares, loads, left = _by_plane(plane), [], []
    for end, fitting_m in zip(ends, fittings_m, strict=True):
        give = end.give()[0]
        loads.append(_GIVE_SD_M_N * give[:, None] * shares)
        left.append(_GIVE_M_N * give)
        if fitting_m:
            stiffened, weighed = (each[0] for each in end.fitting(fitting_m))
            loads += [_RIGID_SD * stiffened[:, None] * shares]
            loads += [_HEAVIER_SD * weighed[:, None] * shares]
            left += [_RIGID * stiffened, _HEAVIER * weighed]
    mode = np.column_stack([plane, order])
    same = (mode[:, None] == np.unique(mode, axis=0)).all(axis=2)
    beyond = _SECOND_ORDER * np.sqrt(np.square(left).sum(axis=0))
    return np.hstack([*loads, beyond[:, None] * same])


def errors_of_bar(
    hanger: Hanger,
    order: IntArray,
    felt: Callable[[FloatArray], FloatArray],
    places_m: tuple[float, ...] = (),
) -> tuple[FloatArray, FloatArray]:
    """The mean (F,) of what sensors do to ln of frequencies of these orders (from 1), and the loads
    (F, k) of sensors and section.

    `felt` says of places in m what a sensor there that weighs as much as the bar does, (F, places);
    `places_m` are the sensors' where they are known.
    """
    mean, sensor = _sensors(hanger, felt, places_m)
    return mean, np.hstack([sensor, _section(hanger, order)])


def felt_by(deck: EndWaves) -> Callable[[FloatArray], FloatArray]:
    """By which ln f of each mode (F,) changes by a mass as large as the bar's at places (places,).

    From the modes near the deck's end, of one parameter set: sensors are within reach of it.
    """

    def felt(x_m: FloatArray) -> FloatArray:
        return -(np.column_stack([deck.deflection(float(x))[0] for x in x_m]) ** 2)

    return felt


def shared_loads(
    hanger: Hanger, plane: IntArray, order: IntArray, frequency_hz: FloatArray
) -> FloatArray:
    """Loads (F, k) of sensors and of both supports together, about no such error, k whatever the
    data are.

    For a hypothesis among whose rivals a heavy sensor or a support that gives way are: the mean is
    theirs to claim.
    """
    felt = _share(hanger) * _of_string(hanger, order, _within_reach_m(hanger, _FEW_PLACES))
    sensor = np.hypot(_SENSOR_KG, _SENSOR_SD_KG) / np.sqrt(_FEW_PLACES) * felt
    size = np.sqrt(2) * _GIVE_SD_M_N * _lowered(hanger, order, frequency_hz)
    return np.hstack([sensor, -size[:, None] * _by_plane(plane)])


def _of_string(hanger: Hanger, order: IntArray, x_m: FloatArray) -> FloatArray:
    """By which ln f of a pinned string changes by a mass as large as its own (F, places)."""
    return np.asarray(-(np.sin(np.pi * np.outer(order, x_m / hanger.length_m)) ** 2))


def _share(hanger: Hanger) -> float:
    """A kilogram as a share of the bar's mass; less where a usual sensor would be more than its
    share of a light bar.
    """
    mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
    return min(1.0, _MOST_OF_BAR * mass_kg / _SENSOR_KG) / mass_kg


def _within_reach_m(hanger: Hanger, count: int) -> FloatArray:
    """Places (count,) spread evenly over where a sensor may be."""
    low, high = np.minimum(_REACH_M, np.array([0.1, 0.5]) * hanger.length_m)
    return np.asarray(low + (high - low) * (np.arange(count) + 0.5) / count)


def _lowered(hanger: Hanger, order: IntArray, frequency_hz: FloatArray) -> FloatArray:
    """By which part a pinned bar's frequency falls per m/N that a support of its plane gives way:
    4 m L f^2/n^2, its reaction being m omega^2/q of the amplitude.
    """
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
    hanger: Hanger, felt: Callable[[FloatArray], FloatArray], places_m: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Mean (F,) and loads (F, k) of the sensors' mass."""
    if places_m:
        each = _share(hanger) * felt(np.array(places_m))
        return _SENSOR_KG * each.sum(axis=1), np.asarray(_SENSOR_SD_KG * each)
    each = _share(hanger) * felt(_within_reach_m(hanger, _PLACES))
    mean = _SENSOR_KG * each.mean(axis=1)
    square = (_SENSOR_KG**2 + _SENSOR_SD_KG**2) * each @ each.T / _PLACES
    variance, ways = np.linalg.eigh(square - np.outer(mean, mean))
    kept = variance > _LEAST_SHARE * variance.max()
    return mean, np.asarray(ways[:, kept] * np.sqrt(variance[kept]))
