"""The trial functions: Hermite cubics, Legendre polynomials, kinks at breaks, shear strain.

Everything is a function of x from 0 (deck end) to 1 (arch end) of a bar of unit length. The four
Hermite cubics carry deflection and slope of the ends. The polynomials that follow have a curvature
of one Legendre polynomial each, which makes them vanish with their slope at both ends and their
bending energies orthogonal: the p-version of finite elements (Szabo and Babuska 1991), one element
for the whole bar. For m modes to 1e-6 it takes 2 m + 4 of them, or 2.2 sqrt(xi) where a tension of
xi = L sqrt(T/EI) bends the bar in thin layers at its ends.

Trial functions with a kink at a place: what smooth polynomials cannot follow.

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

from shm.values import FloatArray, IntArray

HERMITE = 4
"""The end functions come first."""
DECK_DEFLECTION, DECK_SLOPE, ARCH_DEFLECTION, ARCH_SLOPE = range(HERMITE)
DEFLECTIONS = (DECK_DEFLECTION, ARCH_DEFLECTION)
SLOPES = (DECK_SLOPE, ARCH_SLOPE)
SHEAR_ENDS = 2
"""Of the shear strains, those that are not 0 at both ends; they come first."""
# Numerical: a slower decay is nearly a polynomial, a quicker one too thin for the points of
# integration; with a mass of a tenth of the bar's this moves frequencies by 3e-5 at xi = 400.
_LEAST_DECAY, _MOST_DECAY = 1.0, 300.0

_NOTHING = 1e-10  # numerical: the same to rounding from 1e-6 to 1e-13


@dataclass(frozen=True, eq=False)
class Table:
    """Deflection `w` of all functions with its derivatives at points: (functions, rows, points)."""

    w: FloatArray
    slope: FloatArray
    curvature: FloatArray

    @classmethod
    def joined(cls, *tables: Table) -> Table:
        return cls(*(np.concatenate(parts) for parts in zip(*map(_fields, tables), strict=True)))

    def part(self, points: IntArray) -> Table:
        """Return the same at some of the points."""
        return Table(*(field[..., points] for field in _fields(self)))

    def scaled(self, factor: FloatArray) -> Table:
        """Each function times `factor` (functions, rows)."""
        return Table(*(field * factor[..., None] for field in _fields(self)))


def _fields(table: Table) -> tuple[FloatArray, FloatArray, FloatArray]:
    return table.w, table.slope, table.curvature


def hermite(x: FloatArray) -> Table:
    """Return the end functions at `x` (rows, points)."""
    one, s = np.ones_like(x), x
    squared = s * s
    hump = s - squared
    bump, bend = hump * s, 6 - 12 * s
    arch = squared + 2 * bump
    return Table(
        np.stack([one - arch, hump - bump, arch, -bump]),
        np.stack([-6 * hump, one - s - 3 * hump, 6 * hump, s - 3 * hump]),
        np.stack([-bend, -one * 4 + 6 * s, bend, -one * 2 + 6 * s]),
    )


def polynomials(x: FloatArray, count: int) -> Table:
    """`count` functions whose curvature is sqrt(2 k + 1) P_k(2 x - 1), k = 2, 3, ..."""
    p = _legendre(x, count + 4)
    k = np.arange(2.0, count + 2)[:, None, None]
    # The integral of P_k is (P_k+1 - P_k-1)/(2 k + 1), here over half the argument.
    root = np.sqrt(2 * k + 1)
    above, below = root / (8 * k + 12), root / (8 * k - 4)
    odd = p[3 : count + 3] - p[1 : count + 1]
    over = p[4 : count + 4] - p[2 : count + 2]
    under = p[2 : count + 2] - p[:count]
    w = (above * over - below * under) / (2 * k + 1)
    return Table(w, odd / (2 * root), root * p[2 : count + 2])


def shear_strains(x: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Shear strain and its derivative, (count, rows, points): 1 - x, x, then hats of Legendre.

    From the third on they vanish at both ends.
    """
    p = _legendre(x, count)
    k = np.arange(1.0, count - 1)[:, None, None]
    root = np.sqrt(2 * k + 1)
    hats, slopes = (p[2:] - p[:-2]) / (2 * root), root * p[1:-1]
    one = np.ones_like(x)
    return np.concatenate([[one - x, x], hats]), np.concatenate([[-one, one], slopes])


def _legendre(x: FloatArray, count: int) -> FloatArray:
    """Legendre polynomials 0 ... count - 1 of 2 x - 1, shape (count, rows, points)."""
    t = 2 * x - 1
    p = np.empty((count, *x.shape))
    p[0], p[1] = 1, t
    for k in range(1, count - 1):
        np.multiply(t, p[k], out=p[k + 1])
        p[k + 1] *= (2 * k + 1) / (k + 1)
        p[k + 1] -= k / (k + 1) * p[k - 1]
    return p


def tents(x: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return tents with their tops at `places` (rows, places), and their slopes at `x`.

    Both are (places, rows, points); slopes have a mean square of 1. One at an end vanishes.
    """
    at = places.T[..., None]
    size = np.sqrt(at * (1 - at))
    scale = np.where(size > _NOTHING, 1 / np.where(size > _NOTHING, size, 1.0), 0.0)
    left = x < at
    return (
        np.asarray(np.where(left, x * (1 - at), (1 - x) * at) * scale),
        np.asarray(np.where(left, 1 - at, -at) * scale),
    )


@dataclass(frozen=True, eq=False)
class Kinks:
    """Places (rows, places) from 0 to 1 of point forces and of steps, and the `decay` (rows,).

    The shear force jumps at `jumps`. A place at an end makes functions that vanish.
    """

    forces: FloatArray
    steps: FloatArray
    jumps: FloatArray
    decay: FloatArray

    @property
    def places(self) -> FloatArray:
        return np.concatenate([self.forces, self.steps], axis=1)

    @property
    def first(self) -> Kinks:
        """Return those of the first row."""
        return Kinks(self.forces[:1], self.steps[:1], self.jumps[:1], self.decay[:1])

    @property
    def count(self) -> int:
        return int(self.forces.shape[1] + 3 * self.steps.shape[1])

    def table(self, x: FloatArray) -> Table:
        """Return the functions at `x` (rows, points)."""
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
    """Return sums (kinks, rows, points) of cubics (4, rows, points) by factors (4, kinks, rows)."""
    return np.asarray((held.transpose(2, 1, 0) @ cubic.transpose(1, 0, 2)).transpose(1, 0, 2))


def _decay(away: FloatArray, side: FloatArray, s: FloatArray) -> Table:
    """Integrate a curvature of exp(-s away) twice; `side` is the sign of the direction away."""
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
