"""The two-node Timoshenko beam element with exact static shape functions, in tension.

J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), 5.6; A. W. Friedman and J. B.
Kosmatka, An improved two-node Timoshenko beam finite element, Computers & Structures 47 (1993).
Without shear it is the Hermite element. The integrals of products of polynomials are Gauss sums.
"""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_S, _W = (_POINTS + 1) / 2, _WEIGHTS / 2


def stiffness_of(
    size_m: FloatArray, bending_n_m2: FloatArray, shear_compliance_1_n: float, tension_n: float
) -> FloatArray:
    """Stiffness (elements, 4, 4) over deflection, rotation, deflection, rotation."""
    phi = 12 * bending_n_m2 * shear_compliance_1_n / size_m**2
    h, one = size_m, np.ones_like(size_m)
    rows = [
        [12 * one, 6 * h, -12 * one, 6 * h],
        [6 * h, (4 + phi) * h**2, -6 * h, (2 - phi) * h**2],
        [-12 * one, -6 * h, 12 * one, -6 * h],
        [6 * h, (2 - phi) * h**2, -6 * h, (4 + phi) * h**2],
    ]
    bent = np.moveaxis(np.array(rows), -1, 0) * (bending_n_m2 / h**3 / (1 + phi))[:, None, None]
    slopes = _slopes(h, phi)
    return np.asarray(bent + tension_n * _gram(slopes, h))


def mass_of(
    size_m: FloatArray,
    bending_n_m2: FloatArray,
    shear_compliance_1_n: float,
    mass_per_length_kg_m: FloatArray,
    rotary_inertia_kg_m: float,
) -> FloatArray:
    """Consistent mass with rotary inertia, (elements, 4, 4)."""
    phi = 12 * bending_n_m2 * shear_compliance_1_n / size_m**2
    moved = _gram(_deflections(size_m, phi), size_m) * mass_per_length_kg_m[:, None, None]
    if rotary_inertia_kg_m == 0:
        return np.asarray(moved)
    return np.asarray(moved + rotary_inertia_kg_m * _gram(_rotations(size_m, phi), size_m))


def load_of(
    size_m: FloatArray, bending_n_m2: FloatArray, shear_compliance_1_n: float
) -> FloatArray:
    """The integral of the deflection, (elements, 4)."""
    phi = 12 * bending_n_m2 * shear_compliance_1_n / size_m**2
    return np.asarray(np.einsum("p,epi,e->ei", _W, _deflections(size_m, phi), size_m))


def _gram(functions: FloatArray, size_m: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("p,epi,epj,e->eij", _W, functions, functions, size_m))


def _deflections(h: FloatArray, phi: FloatArray) -> FloatArray:
    """Shape functions of the deflection at the Gauss points, (elements, points, 4)."""
    s, p, h = _S, phi[:, None], h[:, None]
    return np.asarray(
        np.stack(
            [
                1 - 3 * s**2 + 2 * s**3 + p * (1 - s),
                h * (s - 2 * s**2 + s**3 + p / 2 * (s - s**2)),
                3 * s**2 - 2 * s**3 + p * s,
                h * (s**3 - s**2 - p / 2 * (s - s**2)),
            ],
            axis=-1,
        )
        / (1 + p)[..., None]
    )


def _slopes(h: FloatArray, phi: FloatArray) -> FloatArray:
    """Derivatives of the deflections by the place."""
    s, p, h = _S, phi[:, None], h[:, None]
    one = np.ones_like(h)
    return np.asarray(
        np.stack(
            [
                (6 * s**2 - 6 * s - p) / h,
                one * (1 - 4 * s + 3 * s**2 + p / 2 * (1 - 2 * s)),
                (6 * s - 6 * s**2 + p) / h,
                one * (3 * s**2 - 2 * s - p / 2 * (1 - 2 * s)),
            ],
            axis=-1,
        )
        / (1 + p)[..., None]
    )


def _rotations(h: FloatArray, phi: FloatArray) -> FloatArray:
    """Shape functions of the cross-section's rotation."""
    s, p, h = _S, phi[:, None], h[:, None]
    one = np.ones_like(h)
    return np.asarray(
        np.stack(
            [
                (6 * s**2 - 6 * s) / h,
                one * (1 - 4 * s + 3 * s**2 + p * (1 - s)),
                (6 * s - 6 * s**2) / h,
                one * (3 * s**2 - 2 * s + p * s),
            ],
            axis=-1,
        )
        / (1 + p)[..., None]
    )
