"""The bar alone: its energies over the trial functions, for unit length, stiffness and mass.

Where along the bar something happens, as fractions of its length, and the bar that results.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from shm.models.hanger.functions import (
    DECK_SLOPE,
    HERMITE,
    SHEAR_ENDS,
    Kinks,
    Table,
    hermite,
    normalised,
    polynomials,
    shear_strains,
)
from shm.models.hanger.physical import PhysicalHanger, PointMass, Zone
from shm.values import FloatArray, IntArray

_RIDGE = 1e-10
"""Added to the bending energy of kinks, so that two at one place do no harm."""


@dataclass(frozen=True)
class Counts:
    """Count the polynomials and the functions of shear strain (0: none)."""

    polynomials: int
    shear: int


@dataclass(frozen=True, eq=False)
class Spans:
    """Stretches between the breaks, (rows, spans): where they begin, how long they are, factors.

    `stiffness_factor` is (planes or 1, rows, spans).
    """

    start: FloatArray
    length: FloatArray
    stiffness_factor: FloatArray
    mass_factor: FloatArray

    @property
    def are_equal(self) -> bool:
        """Return True where all rows have the same stretches."""
        apart = np.ptp(self.start, axis=0).max(), np.ptp(self.length, axis=0).max()
        return bool(max(apart) < _AT_END)


@dataclass(frozen=True, eq=False)
class Bar:
    """Twice the energies of all functions, each (rows or 1, functions, functions).

    Of curvature, deflection's slope, deflection, shear strain, and the rotation of the section;
    `gradient` is that of a tension x - 1/2, which grows along the bar; rotation goes with mass;
    `bending` goes by plane: (rows or 1, planes or 1, functions, functions).
    `area` (rows or 1, functions) is the integral of the deflection. The functions: four Hermite
    cubics, polynomials, kinks, shear strains.
    """

    bending: FloatArray
    tension: FloatArray
    gradient: FloatArray
    mass: FloatArray
    shear: FloatArray
    rotation: FloatArray
    area: FloatArray
    counts: Counts
    kinks: Kinks | None = None
    kink_factor: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def hats(self) -> int:
        """Return the number of functions, the last ones, of shear strain that deflect nothing."""
        return max(self.counts.shear - SHEAR_ENDS, 0)

    def deflections(self, x: FloatArray) -> FloatArray:
        """Return the deflections (rows, points, functions but hats) at `x` (rows, points)."""
        return self._with_sheared(self._at(x).w)

    def slopes(self, x: FloatArray) -> FloatArray:
        """Return the slopes of the axis, likewise."""
        return self._with_sheared(self._at(x).slope)

    def _at(self, x: FloatArray) -> Table:
        smooth = Table.joined(hermite(x), polynomials(x, self.counts.polynomials))
        if self.kinks is None:
            return smooth
        return Table.joined(smooth, self.kinks.table(x).scaled(self.kink_factor))

    def _with_sheared(self, values: FloatArray) -> FloatArray:
        if self.counts.shear:
            values = np.concatenate([values, _sheared(values, SHEAR_ENDS)])
        return values.transpose(1, 2, 0)


@lru_cache(maxsize=64)
def uniform_bar(counts: Counts) -> Bar:
    """One row that stands for all: the bar without zones and kinks."""
    points, weights = _gauss(counts.polynomials + HERMITE)
    x = points[None]
    table = Table.joined(hermite(x), polynomials(x, counts.polynomials))
    return _bar(x, table, weights[None], weights[None, None], weights[None], counts)


def broken_bar(counts: Counts, spans: Spans, kinks: Kinks) -> Bar:
    """Return bars with zones, and functions with kinks."""
    if spans.are_equal and np.ptp(kinks.places, axis=0).max(initial=0.0) < _AT_END:
        return _bar_of_pieces(counts, spans, kinks)
    x, weight, which = _composite(spans, counts.polynomials + HERMITE)
    stiff = weight * np.take_along_axis(spans.stiffness_factor, which[None], axis=2)
    heavy = weight * np.take_along_axis(spans.mass_factor, which, axis=1)
    smooth = Table.joined(hermite(x), polynomials(x, counts.polynomials))
    if not kinks.count:
        return _bar(x, smooth, weight, stiff, heavy, counts)
    bent = kinks.table(x)
    factor = normalised(bent.curvature, weight)
    bar = _bar(x, Table.joined(smooth, bent.scaled(factor)), weight, stiff, heavy, counts)
    first = HERMITE + counts.polynomials
    kinked = np.arange(first, first + kinks.count)
    bar.bending[:, :, kinked, kinked] += np.where(factor > 0, _RIDGE, 1.0).T[:, None]
    return Bar(**{**vars(bar), "kinks": kinks, "kink_factor": factor})


def _bar_of_pieces(counts: Counts, spans: Spans, kinks: Kinks) -> Bar:
    """Return bars whose stretches are alike, put together from those of each stretch.

    So most of the work is done once. Kinks take the next of a few rates of decay.
    """
    level = np.round(np.log(kinks.decay.clip(1.0, _MOST_DECAY)) / _DECAY_STEP).astype(int)
    level = level if kinks.count else 0 * level
    levels, which = np.unique(level, return_inverse=True)
    places = tuple(kinks.forces[0].tolist()), tuple(kinks.steps[0].tolist())
    start, length = tuple(spans.start[0].tolist()), tuple(spans.length[0].tolist())
    pieces = [_pieces(counts, start, length, *places, int(each)) for each in levels]

    def each_row(name: str) -> FloatArray:
        found = [getattr(piece, name) for piece in pieces]
        return np.asarray(found[0] if len(found) == 1 else np.concatenate(found)[which])

    def summed(name: str, factor: FloatArray) -> FloatArray:
        rows, size = len(which), getattr(pieces[0], name).shape[-1]
        found = np.empty((rows, size, size))
        for k, piece in enumerate(pieces):
            of = np.flatnonzero(which == k)
            flat = getattr(piece, name).reshape(factor.shape[1], -1)
            found[of] = (factor[of] @ flat).reshape(len(of), size, size)
        return found

    bending = [summed("bending", plane) for plane in spans.stiffness_factor]
    first = HERMITE + counts.polynomials
    kinked = np.arange(first, first + kinks.count)
    factor = each_row("kink_factor")
    for plane in bending:
        plane[:, kinked, kinked] += np.where(factor > 0, _RIDGE, 1.0)
    rate = np.exp(_DECAY_STEP * level) if kinks.count else kinks.decay
    return Bar(
        np.stack(bending, axis=1),
        each_row("tension"),
        each_row("gradient"),
        summed("mass", spans.mass_factor),
        each_row("shear"),
        summed("rotation", spans.mass_factor) if counts.shear else each_row("tension"),
        each_row("area"),
        counts,
        Kinks(kinks.forces, kinks.steps, rate) if kinks.count else None,
        factor.T if len(factor) > 1 else np.repeat(factor.T, len(which), axis=1),
    )


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Energies of the stretches of one bar.

    `bending`, `mass` and `rotation` are (stretches, functions, functions), the others those of the
    whole bar with one row; `kink_factor` (1, kinks).
    """

    bending: FloatArray
    mass: FloatArray
    rotation: FloatArray
    tension: FloatArray
    gradient: FloatArray
    shear: FloatArray
    area: FloatArray
    kink_factor: FloatArray


@lru_cache(maxsize=128)
def _pieces(
    counts: Counts,
    start: tuple[float, ...],
    length: tuple[float, ...],
    forces: tuple[float, ...],
    steps: tuple[float, ...],
    level: int,
) -> _Pieces:
    """Return the energies of stretches that begin at `start`, with a decay of kinks by `level`."""
    count = len(start)
    one = np.ones((1, count))
    spans = Spans(np.array([start]), np.array([length]), one[None], one)
    x, weight, which = _composite(spans, counts.polynomials + HERMITE)
    table = Table.joined(hermite(x), polynomials(x, counts.polynomials))
    kinks = Kinks(np.array([forces]), np.array([steps]), np.array([np.exp(_DECAY_STEP * level)]))
    factor = np.empty((0, 1))
    if kinks.count:
        bent = kinks.table(x)
        factor = normalised(bent.curvature, weight)
        table = Table.joined(table, bent.scaled(factor))
    whole = _bar(x, table, weight, weight[None], weight, counts)
    parts = []
    for stretch in range(count):
        rows = np.flatnonzero(which[0] == stretch)
        weights = weight[:, rows]
        parts.append(_bar(x[:, rows], table.part(rows), weights, weights[None], weights, counts))
    return _Pieces(
        np.concatenate([each.bending[:, 0] for each in parts]),
        np.concatenate([each.mass for each in parts]),
        np.concatenate([each.rotation for each in parts]),
        whole.tension,
        whole.gradient,
        whole.shear,
        whole.area,
        factor.T,
    )


def _bar(
    x: FloatArray,
    table: Table,
    weight: FloatArray,
    stiff: FloatArray,
    heavy: FloatArray,
    counts: Counts,
) -> Bar:
    w, slope, bend, rotation = table.w, table.slope, table.curvature, table.slope
    shear = np.zeros((1, 1, 1))
    if counts.shear:
        strain, change = shear_strains(x, counts.shear)
        none = np.zeros_like(w)
        w = np.concatenate([w, _sheared(w, counts.shear)])
        slope = np.concatenate([slope, _sheared(slope, counts.shear)])
        bend = np.concatenate([bend, _sheared(bend, counts.shear) - change])
        strain = np.concatenate([none, strain])
        rotation = slope - strain
        shear = _energy(strain, weight)
    return Bar(
        np.stack([_energy(bend, plane) for plane in stiff], axis=1),
        _energy(slope, weight),
        _energy(slope, weight * (x - 0.5)),
        _energy(w, heavy),
        shear,
        _energy(rotation, heavy),
        np.einsum("fnq,nq->nf", w, weight),
        counts,
    )


def _sheared(field_: FloatArray, count: int) -> FloatArray:
    """Return the deflection that goes with the shear strains.

    The first two strain an end, whose section stays as it is while the bar's axis turns.
    """
    follows = np.zeros((count, *field_.shape[1:]))
    follows[:SHEAR_ENDS] = field_[DECK_SLOPE:HERMITE:2]
    return follows


def _energy(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Integrals of all products, (rows, functions, functions)."""
    rows = values.transpose(1, 0, 2)
    return np.asarray((rows * weight[:, None]) @ rows.transpose(0, 2, 1))


def _composite(spans: Spans, count: int) -> tuple[FloatArray, FloatArray, IntArray]:
    """Gauss points (rows, points) of all spans, their weights, and the span that each is in.

    The longer a span, the more points: of polynomials over the whole bar, the i-th longest span
    sees at most the share of the oscillations that an end piece of length 1/i has.
    """
    order = np.argsort(-spans.length, axis=1)
    start = np.take_along_axis(spans.start, order, axis=1)
    length = np.take_along_axis(spans.length, order, axis=1)
    x, weight, which = [], [], []
    for rank in range(start.shape[1]):
        share = np.arccos(1 - 2 / (rank + 1)) / np.pi
        points, weights = _gauss(int(np.ceil(count * share)) + 4)
        x.append(start[:, rank, None] + length[:, rank, None] * points)
        weight.append(length[:, rank, None] * weights)
        which.append(np.repeat(order[:, rank, None], len(points), axis=1))
    return np.hstack(x), np.hstack(weight), np.hstack(which)


@lru_cache(maxsize=256)
def _gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Points and weights on 0 to 1."""
    points, weights = legendre.leggauss(count)
    return (points + 1) / 2, weights / 2


_LIGHT, _SOFT = 2e-3, 20.0
"""A mass below this share of the bar's, a spring below this many EI/L^3, moves frequencies by less
than 1e-6 of what smooth functions do not already say."""

_AT_END = 1e-9  # rounding of places along the bar
_DECAY_STEP = 0.25  # numerical: of the logarithm of the rate of a kink's decay

# Numerical: frequencies beside a zone three times as stiff are right to 1e-6, with shear to 1e-5;
# those of a uniform bar need none more.
_SHEAR_MORE = 2
_ZONES_MORE = 2

_MOST_DECAY = 1000.0  # technical: at most 70 functions; stiffer in tension a bar is a string


def along(physical: PhysicalHanger, x_m: FloatArray) -> FloatArray:
    """Return places (n, points) as fractions of the bar; those beyond its ends move with them."""
    share = (x_m - physical.deck_end_m[:, None]) / physical.length_m[:, None]
    return np.asarray(np.clip(share, 0.0, 1.0))


def by_plane(zone: Zone) -> FloatArray:
    """Return a zone's stiffness factor (n, planes or 1); given as (n,) it is of both planes."""
    factor = zone.stiffness_factor
    return factor if factor.ndim == 2 else factor[:, None]


def stiffness_ratio(physical: PhysicalHanger) -> FloatArray:
    """T L^2/EI (n, planes)."""
    return _over_bending(physical, physical.tension_n)


def gradient_ratio(physical: PhysicalHanger) -> FloatArray:
    """Return by how much T L^2/EI (n, planes) grows from the deck end to the arch end."""
    return _over_bending(physical, physical.tension_gradient_n)


def _over_bending(physical: PhysicalHanger, force_n: FloatArray) -> FloatArray:
    force = (force_n * physical.length_m**2)[:, None]
    return np.asarray(force / physical.bending_stiffness_n_m2)


def bar_of(physical: PhysicalHanger, modes: int) -> Bar:
    """Return the bar with its zones, and with kinks at masses, springs and zones' edges.

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
    """Both ends of all zones, then masses that turn: there the bending moment jumps (n, places)."""
    places = [x for zone in physical.zones for x in (zone.start_m, zone.end_m)]
    places += [m.x_m for m in _heavy(physical) if m.radius_of_gyration_m is not None]
    return along(physical, _columns(places, len(physical.tension_n)))


def _heavy(physical: PhysicalHanger) -> list[PointMass]:
    """Return the masses that smooth functions would blur."""
    bar_kg = physical.mass_per_length_kg_m * physical.length_m
    return [mass for mass in physical.masses if np.any(mass.mass_kg > _LIGHT * bar_kg)]


def _columns(values: list[FloatArray], rows: int) -> FloatArray:
    return np.stack(values, axis=1) if values else np.empty((rows, 0))


def _inside(places: FloatArray) -> FloatArray:
    """Return the columns that lie inside the bar in any row, each once."""
    inside = np.any((places > _AT_END) & (places < 1 - _AT_END), axis=0)
    distinct: list[FloatArray] = []
    for column in places.T[inside]:
        if not any(np.array_equal(column, other) for other in distinct):
            distinct.append(column)
    return _columns(distinct, len(places))


def _forces(physical: PhysicalHanger) -> FloatArray:
    """Places (n, kinks) of point masses and springs that smooth functions would blur."""
    unit = physical.bending_stiffness_n_m2.min(axis=1) / physical.length_m**3
    places = [m.x_m for m in _heavy(physical) if m.radius_of_gyration_m is None]
    for spring in physical.springs:
        if np.any(spring.stiffness_n_m.max(axis=1) > _SOFT * unit):
            places.append(spring.x_m)
    return _inside(along(physical, _columns(places, len(physical.tension_n))))


def _spans(physical: PhysicalHanger, edges: FloatArray, kinks: Kinks) -> Spans:
    """Return the stretches between all breaks, with the factors of the zones that cover them."""
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
    equal = all(np.array_equal(each[:, 0], each[:, -1]) for each in map(by_plane, physical.zones))
    return 1 if equal else physical.bending_stiffness_n_m2.shape[1]
