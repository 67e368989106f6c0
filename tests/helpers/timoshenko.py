"""A clamped Timoshenko beam under tension, by Legendre polynomials."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre, legendre
from scipy.linalg import eigh

from shm.values import FloatArray, Hanger

_TERMS = 40
_POISSONS_RATIO = 0.3


def clamped_frequencies_hz(
    hanger: Hanger, length_m: float, tension_n: float, modes: int
) -> FloatArray:
    """Frequencies (modes,) with deflection and rotation held at both ends.

    The shear coefficient of a circle is that of Cowper (1966). Tension works on the deflection's
    slope.
    """
    x, weights = legendre.leggauss(2 * _TERMS)
    value, slope = _bubbles(x)
    slope = slope * 2 / length_m
    weights = weights * length_m / 2

    def integral(left: FloatArray, right: FloatArray) -> FloatArray:
        return np.asarray((left * weights) @ right.T)

    modulus, area = hanger.elastic_modulus_pa, hanger.area_m2
    density = hanger.mass_per_length_kg_m / area
    coefficient = 6 * (1 + _POISSONS_RATIO) / (7 + 6 * _POISSONS_RATIO)
    shear = coefficient * area * modulus / (2 * (1 + _POISSONS_RATIO))
    bending = modulus * hanger.second_moment_m4 * integral(slope, slope)
    coupling = -shear * integral(slope, value)
    stiffness = np.block(
        [
            [(shear + tension_n) * integral(slope, slope), coupling],
            [coupling.T, bending + shear * integral(value, value)],
        ]
    )
    mass_unit, none = integral(value, value), np.zeros((_TERMS, _TERMS))
    mass = np.block(
        [
            [density * area * mass_unit, none],
            [none, density * hanger.second_moment_m4 * mass_unit],
        ]
    )
    eigenvalues = eigh(stiffness, mass, eigvals_only=True)[:modes]
    return np.asarray(np.sqrt(eigenvalues) / (2 * np.pi))


def _bubbles(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and slopes (terms, points) of polynomials that vanish at -1 and 1."""
    pairs = [Legendre.basis(n + 2) - Legendre.basis(n) for n in range(_TERMS)]
    return np.array([p(x) for p in pairs]), np.array([p.deriv()(x) for p in pairs])
