"""Trial functions with a kink at a place: what smooth polynomials cannot follow.

Beside a point force a tensioned bar's curvature decays like exp(-s |x - x0|), s = L sqrt(T/EI), and
its third derivative jumps: one function holds both. Where the section changes, the curvature jumps
as well and decays differently on either side: two decaying halves and a step. Each is twice
integrated and freed of deflection and slope at the ends by Hermite cubics. With them a force or a
step costs one or three functions wherever it is, and no element is ever cut. (Enrichment of a
Galerkin basis by known local solutions: Babuska and Melenk 1997.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.models.hanger.functions import Table, hermite
from shm.values import FloatArray

_LEAST_DECAY, _MOST_DECAY = 1.0, 300.0
_NOTHING = 1e-10


@dataclass(frozen=True, eq=False)
class Kinks:
    """Places (rows, places) from 0 to 1 of point forces and of steps, and the `decay` (rows,).

    A place at an end makes functions that vanish.
    """

    forces: FloatArray
    steps: FloatArray
    decay: FloatArray

    @property
    def places(self) -> FloatArray:
        return np.concatenate([self.forces, self.steps], axis=1)

    @property
    def count(self) -> int:
        return int(self.forces.shape[1] + 3 * self.steps.shape[1])

    def table(self, x: FloatArray) -> Table:
        """The functions at `x` (rows, points)."""
        raw = self._raw(x)
        ends = self._raw(np.broadcast_to([0.0, 1.0], (len(x), 2)))
        held = np.stack([ends.w[..., 0], ends.slope[..., 0], ends.w[..., 1], ends.slope[..., 1]])
        cubic = hermite(x)
        return Table(
            raw.w - _combined(held, cubic.w),
            raw.slope - _combined(held, cubic.slope),
            raw.curvature - _combined(held, cubic.curvature),
        )

    def _raw(self, x: FloatArray) -> Table:
        s = np.clip(self.decay, _LEAST_DECAY, _MOST_DECAY)[:, None]
        tables = []
        for place in self.forces.T[..., None]:
            tables.append(_decay(np.abs(x - place), np.sign(x - place), s))
        for place in self.steps.T[..., None]:
            right, left = np.maximum(x - place, 0), np.maximum(place - x, 0)
            after, before = (x >= place) * 1.0, (x < place) * 1.0
            tables.append(_half(right, after, s))
            tables.append(_half(left, -before, s))
            # The step is taken on the shorter side, where it is not mistaken for a parabola.
            short = place > 0.5
            away, side = np.where(short, right, left), np.where(short, after, -before)
            tables.append(Table((away**2 / 2)[None], (side * away)[None], np.abs(side)[None]))
        return Table.joined(*tables)


def _combined(held: FloatArray, cubic: FloatArray) -> FloatArray:
    """Sums of the cubics (4, rows, points) by factors (4, kinks, rows): (kinks, rows, points)."""
    return np.asarray((held.transpose(2, 1, 0) @ cubic.transpose(1, 0, 2)).transpose(1, 0, 2))


def _decay(away: FloatArray, side: FloatArray, s: FloatArray) -> Table:
    """A curvature of exp(-s away), twice integrated; `side` is the sign of the direction away."""
    decay = np.exp(-s * away)
    grown = (1 - decay) / s
    return Table(((away - grown) / s)[None], (side * grown)[None], decay[None])


def _half(away: FloatArray, side: FloatArray, s: FloatArray) -> Table:
    whole = _decay(away, side, s)
    return Table(whole.w, whole.slope, whole.curvature * np.abs(side))


def normalised(curvature: FloatArray, weight: FloatArray) -> FloatArray:
    """Factors (functions, rows) that give each function a bending energy of 1, or of 0 if tiny."""
    energy = np.einsum("fnq,nq->fn", curvature**2, weight)
    small = energy < _NOTHING
    return np.asarray(np.where(small, 0.0, 1 / np.sqrt(np.where(small, 1.0, energy))))
