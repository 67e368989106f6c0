"""Where along the bar something happens, as fractions of its length, and the bar that results."""

from __future__ import annotations

import numpy as np

from shm.models.hanger.bar import Bar, Counts, Spans, broken_bar, uniform_bar
from shm.models.hanger.functions import Kinks
from shm.models.hanger.physical import PhysicalHanger, Zone
from shm.values import FloatArray

_LIGHT, _SOFT = 2e-3, 20.0
"""A mass below this share of the bar's, a spring below this many EI/L^3, moves frequencies by less
than 1e-6 of what smooth functions do not already say."""

_AT_END = 1e-9  # rounding of places along the bar

# Numerical: frequencies beside a zone three times as stiff are right to 1e-6, with shear to 1e-5;
# those of a uniform bar need none more.
_SHEAR_MORE = 2
_ZONES_MORE = 2

_MOST_DECAY = 1000.0  # technical: at most 70 functions; stiffer in tension a bar is a string


def along(physical: PhysicalHanger, x_m: FloatArray) -> FloatArray:
    """Places (n, points) on the hanger's axis as fractions of the bar; those beyond its ends move
    with the end."""
    share = (x_m - physical.deck_end_m[:, None]) / physical.length_m[:, None]
    return np.asarray(np.clip(share, 0.0, 1.0))


def by_plane(zone: Zone) -> FloatArray:
    """A zone's stiffness factor (n, planes or 1); given as (n,) it is that of both planes."""
    factor = zone.stiffness_factor
    return factor if factor.ndim == 2 else factor[:, None]


def stiffness_ratio(physical: PhysicalHanger) -> FloatArray:
    """T L^2/EI (n, planes)."""
    tension = (physical.tension_n * physical.length_m**2)[:, None]
    return np.asarray(tension / physical.bending_stiffness_n_m2)


def bar_of(physical: PhysicalHanger, modes: int) -> Bar:
    """The bar with its zones, and with kinks where masses, springs and zones' edges call for them.

    `modes` frequencies of each plane are to be right.
    """
    decay = np.sqrt(np.maximum(stiffness_ratio(physical).max(axis=1), 0.0))
    boundary_layers = int(2.2 * np.sqrt(min(decay.max(initial=0.0), _MOST_DECAY))) + 1
    polynomials = max(2 * modes + 4, boundary_layers) + (_ZONES_MORE if physical.zones else 0)
    shear = polynomials + _SHEAR_MORE if np.any(physical.shear_compliance_1_n > 0) else 0
    counts = Counts(polynomials, shear)
    edges = _edges(physical)
    kinks = Kinks(_forces(physical), _inside(edges), decay)
    if not kinks.count and not physical.zones:
        return uniform_bar(counts)
    return broken_bar(counts, _spans(physical, edges, kinks), kinks)


def _edges(physical: PhysicalHanger) -> FloatArray:
    """Both ends of all zones (n, 2 zones)."""
    ends = [x for zone in physical.zones for x in (zone.start_m, zone.end_m)]
    return along(physical, _columns(ends, len(physical.tension_n)))


def _columns(values: list[FloatArray], rows: int) -> FloatArray:
    return np.stack(values, axis=1) if values else np.empty((rows, 0))


def _inside(places: FloatArray) -> FloatArray:
    """The columns that lie inside the bar in any row, each once."""
    inside = np.any((places > _AT_END) & (places < 1 - _AT_END), axis=0)
    kept: list[FloatArray] = []
    for column in places.T[inside]:
        if not any(np.array_equal(column, other) for other in kept):
            kept.append(column)
    return _columns(kept, len(places))


def _forces(physical: PhysicalHanger) -> FloatArray:
    """Places (n, kinks) of masses and springs that smooth functions would blur."""
    bar_kg = physical.mass_per_length_kg_m * physical.length_m
    unit = physical.bending_stiffness_n_m2.min(axis=1) / physical.length_m**3
    places = [m.x_m for m in physical.masses if np.any(m.mass_kg > _LIGHT * bar_kg)]
    for spring in physical.springs:
        if np.any(spring.stiffness_n_m.max(axis=1) > _SOFT * unit):
            places.append(spring.x_m)
    return _inside(along(physical, _columns(places, len(bar_kg))))


def _spans(physical: PhysicalHanger, edges: FloatArray, kinks: Kinks) -> Spans:
    """The stretches between all breaks, with the factors of the zones that cover them."""
    rows = len(edges)
    ends = np.broadcast_to([0.0, 1.0], (rows, 2))
    breaks = np.sort(np.hstack([ends, edges, kinks.forces]), axis=1)
    start, length = breaks[:, :-1], np.diff(breaks, axis=1)
    middle = start + length / 2
    stiffness: FloatArray = np.ones((_planes(physical), *middle.shape))
    mass: FloatArray = np.ones_like(middle)
    for index, zone in enumerate(physical.zones):
        first, last = edges[:, 2 * index, None], edges[:, 2 * index + 1, None]
        covered = (middle > first) & (middle < last)
        stiffness = stiffness * np.where(covered, by_plane(zone).T[..., None], 1.0)
        mass = mass * np.where(covered, zone.mass_factor[:, None], 1.0)
    return Spans(start, length, stiffness, mass)


def _planes(physical: PhysicalHanger) -> int:
    """1 where no zone tells the planes apart."""
    alike = all(np.array_equal(each[:, 0], each[:, -1]) for each in map(by_plane, physical.zones))
    return 1 if alike else physical.bending_stiffness_n_m2.shape[1]
