"""Errors that every test of a hanger has alike and that physics says the shape of.

The accelerometer's own mass lowers each mode by where it sits, both planes alike; the section
wanders; supports give way sideways and lower high orders of stiff bars; fittings stiffen the ends
(`shm.models.classes.end_effects`); a known mass turns with the bar as much as it is long. All are
small, known to first order and of uncertain size, so that their mean shifts a prediction and what
is uncertain is a few normal errors ("loads": what one standard deviation of each does). The
remaining errors of a mode are tau's (`shm.inference.problem.field`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.models.classes.end_effects import EndWaves
from shm.values import AddedMass, FloatArray, Hanger, IntArray

Ends: TypeAlias = tuple[EndWaves, EndWaves]
"""The deck's and the arch's."""

# Numerical: 16 places within a person's reach are a fifth of a half wave apart at order 10 of 7 m.
_PLACES = 16

# Numerical: left out is a thousandth of the section's scatter, or of the sensors' largest variance.
_LEAST_SHARE = 1e-3


def mean_of_ends(
    ends: Ends, fittings_m: tuple[float, float], assumed: Assumptions = DEFAULTS
) -> FloatArray:
    """Return the mean change of ln of frequencies (n, F) by supports and fittings of both ends."""
    rigid, heavier = assumed.fitting_rigidity.value, assumed.fitting_mass.value
    found = assumed.support_compliance_m_n.value * (ends[0].give() + ends[1].give())
    for end, fitting_m in zip(ends, fittings_m, strict=True):
        if fitting_m:
            stiffened, weighed = end.fitting(fitting_m)
            found = found + rigid * stiffened + heavier * weighed
    return np.asarray(found)


def loads_of_ends(
    ends: Ends,
    fittings_m: tuple[float, float],
    plane: IntArray,
    order: IntArray,
    assumed: Assumptions = DEFAULTS,
    modes: IntArray | None = None,
) -> FloatArray:
    """Return loads (F, k) of the same, of one parameter set: each end by itself, and what the first
    order leaves of each mode.

    `modes` (n, 2) are the planes and orders that have such a load, all that occur if not stated.
    """
    shares, loads, left = _by_plane(plane, assumed), [], []
    support, rigid = assumed.support_compliance_m_n, assumed.fitting_rigidity
    heavier = assumed.fitting_mass
    for end, fitting_m in zip(ends, fittings_m, strict=True):
        give = end.give()[0]
        loads.append(support.sd * give[:, None] * shares)
        left.append(support.value * give)
        if fitting_m:
            stiffened, weighed = (each[0] for each in end.fitting(fitting_m))
            loads += [rigid.sd * stiffened[:, None] * shares]
            loads += [heavier.sd * weighed[:, None] * shares]
            left += [rigid.value * stiffened, heavier.value * weighed]
    mode = np.column_stack([plane, order])
    modes = np.unique(mode, axis=0) if modes is None else modes
    same = (mode[:, None] == modes).all(axis=2)
    beyond = assumed.end_details_model_error.value * np.sqrt(np.square(left).sum(axis=0))
    return np.hstack([*loads, beyond[:, None] * same])


def felt_by(deck: EndWaves) -> Callable[[FloatArray], FloatArray]:
    """By which ln f of each mode (F,) changes by a mass as large as the bar's at places (places,).

    From the modes near the deck's end, of one parameter set: sensors are within reach of it.
    """

    def felt(x_m: FloatArray) -> FloatArray:
        return -(np.column_stack([deck.deflection(float(x))[0] for x in x_m]) ** 2)

    return felt


def loads_of_radii(
    masses: Sequence[AddedMass | None],
    log_frequency: Callable[[float], FloatArray],
    assumed: Assumptions,
) -> FloatArray:
    """Return loads (F, k) of unstated radii of gyration, each known mass by itself.

    `masses` (F,) are those of the frequencies' tests; `log_frequency` says ln f (F,) where what
    states no radius has one of so many metres. Masses of one size are one body.
    """
    is_open = [each is not None and each.radius_of_gyration_m is None for each in masses]
    size_kg = np.array([each.mass_kg if each else 0.0 for each in masses])
    bodies = np.unique(size_kg[is_open])
    if not len(bodies):
        return np.zeros((len(masses), 0))
    radius = assumed.added_mass_radius_m
    larger = log_frequency(radius.value + radius.sd)
    change = (larger - log_frequency(max(radius.value - radius.sd, 0.0))) / 2
    same_body = np.equal.outer(size_kg, bodies) & np.array(is_open)[:, None]
    return np.asarray(np.where(same_body, change[:, None], 0.0))


def _share(hanger: Hanger) -> float:
    """A kilogram as a share of the bar's mass; less where a usual sensor would be more than its
    share of a light bar.
    """
    mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
    assumed = hanger.assumptions
    most_kg = assumed.accelerometer_most_of_bar.value * mass_kg
    usual_kg = assumed.accelerometer_mass_kg.value
    return min(1.0, most_kg / usual_kg if usual_kg else 1.0) / mass_kg


def _within_reach_m(hanger: Hanger, count: int) -> FloatArray:
    """Places (count,) spread evenly over where a sensor may be."""
    reach_m = hanger.assumptions.sensor_place_m.bounds
    low, high = np.minimum(reach_m, np.array([0.1, 0.5]) * hanger.length_m)
    return np.asarray(low + (high - low) * (np.arange(count) + 0.5) / count)


def _by_plane(plane: IntArray, assumed: Assumptions) -> FloatArray:
    """Shares (F, 3) of what the planes have in common and each for itself."""
    shared = assumed.end_details_shared.value
    separate = np.sqrt(1 - shared) * (plane[:, None] == np.arange(2))
    return np.column_stack([np.sqrt(shared) * np.ones(len(plane)), separate])


def loads_of_section(hanger: Hanger, order: IntArray) -> FloatArray:
    """Return loads (F, orders) of a section that wanders along the bar about its mean.

    Of an area 1 + a(x), mode n changes by half of the mean of a(x) cos(2 n pi x/L) in a string, by
    up to 1.5 times it between clamped ends, and is taken to change by once it; the variance of the
    mean over a with correlation exp(-(s/r)^2 / 2) is
    sd^2 sqrt(2 pi) (r/L) exp(-(2 n pi r/L)^2 / 2) / 2. Both planes have it alike.
    """
    reach = min(hanger.assumptions.section_reach_m.value / hanger.length_m, 0.2)
    distinct = np.unique(order)
    variance = np.sqrt(2 * np.pi) * reach * np.exp(-((2 * np.pi * distinct * reach) ** 2) / 2)
    size = hanger.scatter.along * np.sqrt(variance / 2)
    significant = size > _LEAST_SHARE * hanger.scatter.along
    return np.asarray((order[:, None] == distinct[significant]) * size[significant])


def errors_of_sensors(
    hanger: Hanger, felt: Callable[[FloatArray], FloatArray], places_m: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return the mean (F,) of what the sensors' mass does to ln of frequencies, and loads (F, k).

    `felt` says of places in m what a sensor there that weighs as much as the bar does, (F, places);
    `places_m` are the sensors' where they are known. Where none is, one sensor is anywhere within
    reach, at the same place in all tests. k depends on `places_m` alone.
    """
    mass_kg = hanger.assumptions.accelerometer_mass_kg
    if places_m:
        each = _share(hanger) * felt(np.array(places_m))
        return mass_kg.value * each.sum(axis=1), np.asarray(mass_kg.sd * each)
    each = _share(hanger) * felt(_within_reach_m(hanger, _PLACES))
    mean = each.mean(axis=1)
    apart = np.hstack([mass_kg.value * (each - mean[:, None]), mass_kg.sd * each])
    return mass_kg.value * mean, np.asarray(apart / np.sqrt(_PLACES))
