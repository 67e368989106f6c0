"""The bar alone: its energies over the trial functions, for unit length, stiffness and mass."""

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
from shm.values import FloatArray, IntArray

_RIDGE = 1e-10
"""Added to the bending energy of kinks, so that two at one place do no harm."""


@dataclass(frozen=True)
class Counts:
    """How many polynomials, and how many functions of shear strain (0: none)."""

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


@dataclass(frozen=True, eq=False)
class Bar:
    """Twice the energies of all functions, each (rows or 1, functions, functions).

    Of curvature, deflection's slope, deflection, shear strain, and the rotation of the section;
    `bending` goes by plane: (rows or 1, planes or 1, functions, functions).
    `area` (rows or 1, functions) is the integral of the deflection. The functions: four Hermite
    cubics, polynomials, kinks, shear strains.
    """

    bending: FloatArray
    tension: FloatArray
    mass: FloatArray
    shear: FloatArray
    rotation: FloatArray
    area: FloatArray
    counts: Counts
    kinks: Kinks | None = None
    kink_factor: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def hats(self) -> int:
        """How many functions, the last ones, are shear strains that deflect nothing."""
        return max(self.counts.shear - SHEAR_ENDS, 0)

    def deflections(self, x: FloatArray) -> FloatArray:
        """The functions' deflections at `x` (rows, points): (rows, points, functions but hats)."""
        tables = [hermite(x), polynomials(x, self.counts.polynomials)]
        if self.kinks is not None:
            tables.append(self.kinks.table(x).scaled(self.kink_factor))
        w = np.concatenate([table.w for table in tables])
        if self.counts.shear:
            w = np.concatenate([w, _sheared(w, SHEAR_ENDS)])
        return w.transpose(1, 2, 0)


@lru_cache(maxsize=64)
def uniform_bar(counts: Counts) -> Bar:
    """One row that stands for all: the bar without zones and kinks."""
    points, weights = _gauss(counts.polynomials + HERMITE)
    x = points[None]
    table = Table.joined(hermite(x), polynomials(x, counts.polynomials))
    return _bar(x, table, weights[None], weights[None, None], weights[None], counts)


def broken_bar(counts: Counts, spans: Spans, kinks: Kinks) -> Bar:
    """Bars with zones, and functions with kinks."""
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
    tension = _energy(slope, weight)
    return Bar(
        np.stack([_energy(bend, plane) for plane in stiff], axis=1),
        tension,
        _energy(w, heavy),
        shear,
        _energy(rotation, weight) if counts.shear else tension,
        np.einsum("fnq,nq->nf", w, weight),
        counts,
    )


def _sheared(field_: FloatArray, count: int) -> FloatArray:
    """What deflects with the shear strains.

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
