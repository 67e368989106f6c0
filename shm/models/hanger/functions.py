"""The trial functions: Hermite cubics, Legendre polynomials, kinks at breaks, shear strain.

Everything is a function of x from 0 (deck end) to 1 (arch end) of a bar of unit length. The four
Hermite cubics carry deflection and slope of the ends. The polynomials that follow have a curvature
of one Legendre polynomial each, which makes them vanish with their slope at both ends and their
bending energies orthogonal: the p-version of finite elements (Szabo and Babuska 1991), one element
for the whole bar. For m modes to 1e-6 it takes 2 m + 4 of them, or 2.2 sqrt(xi) where a tension of
xi = L sqrt(T/EI) bends the bar in thin layers at its ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray

DECK_DEFLECTION, DECK_SLOPE, ARCH_DEFLECTION, ARCH_SLOPE = range(4)
DEFLECTIONS = (DECK_DEFLECTION, ARCH_DEFLECTION)
SLOPES = (DECK_SLOPE, ARCH_SLOPE)
HERMITE = 4
"""The end functions come first."""
SHEAR_ENDS = 2
"""Of the shear strains, those that are not 0 at both ends; they come first."""


@dataclass(frozen=True, eq=False)
class Table:
    """Deflection `w` of all functions with its derivatives at points: (functions, rows, points)."""

    w: FloatArray
    slope: FloatArray
    curvature: FloatArray

    @classmethod
    def joined(cls, *tables: Table) -> Table:
        return cls(*(np.concatenate(parts) for parts in zip(*map(_fields, tables), strict=True)))

    def scaled(self, factor: FloatArray) -> Table:
        """Each function times `factor` (functions, rows)."""
        return Table(*(field * factor[..., None] for field in _fields(self)))


def _fields(table: Table) -> tuple[FloatArray, FloatArray, FloatArray]:
    return table.w, table.slope, table.curvature


def hermite(x: FloatArray) -> Table:
    """The end functions at `x` (rows, points)."""
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
