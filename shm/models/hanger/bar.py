"""The bar alone: its energies over the trial functions, for unit length, stiffness and mass.

Where along the bar something happens, as fractions of its length, and the bar that results.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
    tents,
)
from shm.models.hanger.physical import PhysicalHanger, PointMass, Zone
from shm.values import FloatArray, IntArray

_RIDGE = 1e-10
"""Added to the bending energy of kinks, so that two at one place do no harm."""


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

    @property
    def first(self) -> Spans:
        """Return those of the first row."""
        factors = self.stiffness_factor[:, :1], self.mass_factor[:1]
        return Spans(self.start[:1], self.length[:1], *factors)


@dataclass(frozen=True, eq=False)
class Motion:
    """Hold what functions do at points, (functions, rows, points) each.

    `w` is the axis's deflection, `slope` its derivative, `curvature` that of the section's
    rotation, which is the slope without the shear `strain`.
    """

    w: FloatArray
    slope: FloatArray
    curvature: FloatArray
    strain: FloatArray


@dataclass(frozen=True, eq=False)
class Functions:
    """The trial functions of bars (rows).

    Four Hermite cubics, `smooth` polynomials and kinks, each times `factor` (kinks, rows); of a bar
    that shears those of shear strain as well: one for each end, one for each place where the shear
    force jumps, then some that deflect nothing, `strains` polynomials less the two of the ends and
    one for each kink.
    """

    smooth: int
    strains: int
    kinks: Kinks
    factor: FloatArray

    @property
    def still(self) -> int:
        """Return the number of functions, the last ones, that deflect nothing."""
        return self.strains - SHEAR_ENDS + self.kinks.places.shape[1] if self.strains else 0

    @property
    def kinked(self) -> slice:
        return slice(HERMITE + self.smooth, HERMITE + self.smooth + self.kinks.count)

    def at(self, x: FloatArray, kinked: Table | None = None) -> Motion:
        """Return the motion of all functions at `x` (rows, points); `kinked` is that of kinks."""
        table = Table.joined(hermite(x), polynomials(x, self.smooth))
        if self.kinks.count:
            kinked = self.kinks.table(x) if kinked is None else kinked
            table = Table.joined(table, kinked.scaled(self.factor))
        if not self.strains:
            return Motion(table.w, table.slope, table.curvature, np.zeros_like(table.w))
        strain, change = shear_strains(x, self.strains)
        # The first two strain an end, whose section stays as it is while the bar's axis turns.
        ends = Table(*(each[DECK_SLOPE:HERMITE:2] for each in vars(table).values()))
        # Where the shear force jumps the axis has a kink, the section none.
        tent, jump = tents(x, self.kinks.jumps)
        tops, rising = tents(x, self.kinks.places)
        still = np.zeros((self.still, *x.shape))
        changing = np.concatenate([change[:SHEAR_ENDS], 0 * tent, change[SHEAR_ENDS:], rising])
        bent = np.concatenate([ends.curvature, 0 * tent, still]) - changing
        return Motion(
            np.concatenate([table.w, ends.w, tent, still]),
            np.concatenate([table.slope, ends.slope, jump, still]),
            np.concatenate([table.curvature, bent]),
            np.concatenate([0 * table.w, strain[:SHEAR_ENDS], jump, strain[SHEAR_ENDS:], tops]),
        )

    def ridge(self) -> FloatArray:
        """Return what makes nearly dependent functions definite (rows, functions), in bending."""
        sizes = [np.ones((HERMITE + self.smooth, 1)), self.factor]
        if self.strains:
            heights = (tents(each, each)[0] for each in (self.kinks.jumps, self.kinks.places))
            jumps, tops = (np.diagonal(each, axis1=0, axis2=2).T for each in heights)
            ones = np.ones((SHEAR_ENDS, 1)), np.ones((self.strains - SHEAR_ENDS, 1))
            sizes += [ones[0], jumps, ones[1], tops]
        rows = max(each.shape[1] for each in sizes)
        size = np.concatenate([np.broadcast_to(each, (len(each), rows)) for each in sizes])
        found = np.where(size > 0, _RIDGE, 1.0)
        found[[*range(HERMITE + self.smooth)]] = 0.0
        return found.T


@dataclass(frozen=True, eq=False)
class Bar:
    """Twice the energies of all functions, each (rows or 1, functions, functions).

    Of curvature, deflection's slope, deflection, shear strain, and the rotation of the section;
    `gradient` is that of a tension x - 1/2, which grows along the bar; rotation goes with mass;
    `bending` goes by plane: (rows or 1, planes or 1, functions, functions).
    `area` (rows or 1, functions) is the integral of the deflection.
    """

    functions: Functions
    bending: FloatArray
    tension: FloatArray
    gradient: FloatArray
    mass: FloatArray
    shear: FloatArray
    rotation: FloatArray
    area: FloatArray

    def deflections(self, x: FloatArray) -> FloatArray:
        """Return the deflections (rows, points, functions that deflect) at `x` (rows, points)."""
        return self._deflecting(self.functions.at(x).w)

    def slopes(self, x: FloatArray) -> FloatArray:
        """Return the slopes of the axis, likewise."""
        return self._deflecting(self.functions.at(x).slope)

    def _deflecting(self, values: FloatArray) -> FloatArray:
        return values[: len(values) - self.functions.still].transpose(1, 2, 0)


def _bar_of_rows(functions: Functions, spans: Spans) -> Bar:
    """Return bars that have their breaks anywhere."""
    x, weight, which = _composite(spans, functions.smooth + HERMITE)
    stiff = weight * np.take_along_axis(spans.stiffness_factor, which[None], axis=2)
    heavy = weight * np.take_along_axis(spans.mass_factor, which, axis=1)
    kinked = None
    if functions.kinks.count:
        kinked = functions.kinks.table(x)
        functions = replace(functions, factor=normalised(kinked.curvature, weight))
    bar = _bar(functions, functions.at(x, kinked), x, weight, stiff, heavy)
    diagonal = np.arange(bar.bending.shape[-1])
    bar.bending[:, :, diagonal, diagonal] += functions.ridge()[:, None]
    return bar


def _bar_of_pieces(functions: Functions, spans: Spans) -> Bar:
    """Return bars whose stretches are alike, put together from those of each stretch.

    So most of the work is done once. Kinks take the next of a few rates of decay. Where all bars
    are the same there is one row, which stands for all.
    """
    kinks = functions.kinks
    level = _decay_levels(kinks)
    levels, which = np.unique(level, return_inverse=True)
    pieces = [bar_pieces(functions.smooth, functions.strains, *_places(spans, kinks), int(each))
              for each in levels]  # fmt: skip
    factors = (*spans.stiffness_factor, spans.mass_factor)
    if len(levels) == 1 and all(np.all(each == each[:1]) for each in factors):
        which, level = which[:1], level[:1]
        spans, kinks = spans.first, kinks.first

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

    bending = np.stack([summed("bending", plane) for plane in spans.stiffness_factor], axis=1)
    factor = each_row("kink_factor")
    factor = factor.T if len(factor) > 1 else np.repeat(factor.T, len(which), axis=1)
    rate = np.exp(_DECAY_STEP * level) if kinks.count else kinks.decay
    functions = replace(functions, kinks=replace(kinks, decay=rate), factor=factor)
    diagonal = np.arange(bending.shape[-1])
    bending[:, :, diagonal, diagonal] += functions.ridge()[:, None]
    return Bar(
        functions,
        bending,
        each_row("tension"),
        each_row("gradient"),
        summed("mass", spans.mass_factor),
        each_row("shear"),
        summed("rotation", spans.mass_factor) if functions.strains else each_row("tension"),
        each_row("area"),
    )


def _decay_levels(kinks: Kinks) -> IntArray:
    level = np.round(np.log(kinks.decay.clip(1.0, _MOST_DECAY)) / _DECAY_STEP).astype(int)
    return np.asarray(level if kinks.count else 0 * level)


def _places(spans: Spans, kinks: Kinks) -> tuple[tuple[float, ...], ...]:
    """Return where the first row's stretches begin, their lengths, its forces, steps and jumps."""
    rows = (spans.start[0], spans.length[0], kinks.forces[0], kinks.steps[0], kinks.jumps[0])
    return tuple(tuple(each.tolist()) for each in rows)


@dataclass(frozen=True, eq=False)
class Pieces:
    """Energies of the stretches of one bar.

    `bending`, `mass` and `rotation` are (stretches, functions, functions), the others those of the
    whole bar with one row; `kink_factor` (1, kinks). `curvature` (points, functions) of each
    stretch is weighted so that its square is the energy of bending; `middle` is its middle.
    """

    bending: FloatArray
    mass: FloatArray
    rotation: FloatArray
    tension: FloatArray
    gradient: FloatArray
    shear: FloatArray
    area: FloatArray
    kink_factor: FloatArray
    curvature: tuple[FloatArray, ...]
    middle: tuple[float, ...]


@lru_cache(maxsize=128)
def bar_pieces(
    smooth: int,
    strains: int,
    start: tuple[float, ...],
    length: tuple[float, ...],
    forces: tuple[float, ...],
    steps: tuple[float, ...],
    jumps: tuple[float, ...],
    level: int,
) -> Pieces:
    """Return the energies of stretches that begin at `start`, with a decay of kinks by `level`."""
    count = len(start)
    one = np.ones((1, count))
    spans = Spans(np.array([start]), np.array([length]), one[None], one)
    x, weight, which = _composite(spans, smooth + HERMITE)
    rate = np.array([np.exp(_DECAY_STEP * level)])
    kinks = Kinks(np.array([forces]), np.array([steps]), np.array([jumps]), rate)
    kinked = kinks.table(x) if kinks.count else None
    factor = np.empty((0, 1)) if kinked is None else normalised(kinked.curvature, weight)
    functions = Functions(smooth, strains, kinks, factor)
    motion = functions.at(x, kinked)
    whole = _bar(functions, motion, x, weight, weight[None], weight)
    parts, curvature = [], []
    for stretch in range(count):
        rows = np.flatnonzero(which[0] == stretch)
        of_rows = Motion(*(each[..., rows] for each in vars(motion).values()))
        weights = weight[:, rows]
        parts.append(_bar(functions, of_rows, x[:, rows], weights, weights[None], weights))
        curvature.append((of_rows.curvature[:, 0] * np.sqrt(weights)).T)
    return Pieces(
        np.concatenate([each.bending[:, 0] for each in parts]),
        np.concatenate([each.mass for each in parts]),
        np.concatenate([each.rotation for each in parts]),
        whole.tension,
        whole.gradient,
        whole.shear,
        whole.area,
        factor.T,
        tuple(curvature),
        tuple(a + b / 2 for a, b in zip(start, length, strict=True)),
    )


def _bar(
    functions: Functions,
    motion: Motion,
    x: FloatArray,
    weight: FloatArray,
    stiff: FloatArray,
    heavy: FloatArray,
) -> Bar:
    return Bar(
        functions,
        np.stack([_energy(motion.curvature, plane) for plane in stiff], axis=1),
        _energy(motion.slope, weight),
        _energy(motion.slope, weight * (x - 0.5)),
        _energy(motion.w, heavy),
        _energy(motion.strain, weight) if functions.strains else np.zeros((1, 1, 1)),
        _energy(motion.slope - motion.strain, heavy),
        np.einsum("fnq,nq->nf", motion.w, weight),
    )


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
_MANY_MORE = 10

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
    functions, edges = _functions(physical, modes, _ZONES_MORE if physical.zones else 0)
    spans, places = _spans(physical, edges, functions.kinks), functions.kinks.places
    if spans.are_equal and np.ptp(places, axis=0).max(initial=0.0) < _AT_END:
        return _bar_of_pieces(functions, spans)
    return _bar_of_rows(functions, spans)


def bar_pieces_of(physical: PhysicalHanger, modes: int) -> tuple[Bar, Pieces]:
    """Return one bar for hangers with breaks at the same places, and the energies of its parts.

    It has the decay of kinks of a middling tension, and more functions than `bar_of` takes.
    """
    functions, edges = _functions(physical, modes, _MANY_MORE)
    spans = _spans(physical, edges, functions.kinks).first
    decay = np.median(functions.kinks.decay, keepdims=True)
    functions = replace(functions, kinks=replace(functions.kinks.first, decay=decay))
    one = np.ones_like(spans.mass_factor)
    spans = replace(spans, stiffness_factor=one[None], mass_factor=one)
    bar = _bar_of_pieces(functions, spans)
    level = int(_decay_levels(functions.kinks)[0])
    places = _places(spans, functions.kinks)
    return bar, bar_pieces(functions.smooth, functions.strains, *places, level)


def _functions(physical: PhysicalHanger, modes: int, more: int) -> tuple[Functions, FloatArray]:
    """Return the functions that bars take, and where their section changes (n, edges)."""
    decay = np.sqrt(np.maximum(stiffness_ratio(physical).max(axis=1), 0.0))
    boundary_layers = int(2.2 * np.sqrt(min(decay.max(initial=0.0), _MOST_DECAY))) + 1
    smooth = max(2 * modes + 4, boundary_layers) + more
    strains = smooth + _SHEAR_MORE if np.any(physical.shear_compliance_1_n > 0) else 0
    edges, forces = _edges(physical), _forces(physical)
    turning = edges[:, 2 * len(physical.zones) :]
    kinks = Kinks(forces, _inside(edges), np.hstack([forces, _inside(turning)]), decay)
    return Functions(smooth, strains, kinks, np.empty((0, len(decay)))), edges


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
