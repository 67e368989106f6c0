"""A Timoshenko beam under tension on rotational springs, by Legendre polynomials."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import block_diag, eigh, null_space

from shm.values import FloatArray, Hanger

_TERMS = 40


def legendre_hz(
    hanger: Hanger,
    length_m: float,
    tension_n: float,
    modes: int,
    springs_n_m_rad: tuple[float, float] = (np.inf, np.inf),
) -> FloatArray:
    """Frequencies (modes,): deflections vanish at the ends, springs there resist rotations.

    The shear coefficient of a circle is that of Cowper (1966). Tension works on the deflection's
    slope.
    """
    x, weights = legendre.leggauss(2 * _TERMS)
    weights, unit = weights * length_m / 2, np.eye(_TERMS)
    bubbles = unit[2:] - unit[:-2]
    springs, ends = np.array(springs_n_m_rad), legendre.legval(np.array([-1.0, 1.0]), unit)
    held = np.isinf(springs)
    free = null_space(ends[:, held].T) if held.any() else unit
    deflection = legendre.legval(x, bubbles.T)
    slope = legendre.legval(x, legendre.legder(bubbles.T)) * 2 / length_m
    turn = free.T @ legendre.legval(x, unit)
    bend = free.T @ legendre.legval(x, legendre.legder(unit)) * 2 / length_m
    ends = free.T @ ends

    def integral(left: Any, right: Any) -> FloatArray:
        return np.asarray((left * weights) @ right.T)

    nu, modulus, area = hanger.poissons_ratio, hanger.elastic_modulus_pa, hanger.area_m2
    shear = 6 * (1 + nu) / (7 + 6 * nu) * modulus / (2 * (1 + nu)) * area
    corner = -shear * integral(slope, turn)
    whole = hanger.bending_stiffness_n_m2 * integral(bend, bend) + shear * integral(turn, turn)
    whole += (ends * np.where(held, 0.0, springs)) @ ends.T
    stiffness = np.block(
        [[(shear + tension_n) * integral(slope, slope), corner], [corner.T, whole]]
    )
    square_m2 = hanger.second_moment_m4 / area
    turning = square_m2 * integral(turn, turn)
    mass = hanger.mass_per_length_kg_m * block_diag(integral(deflection, deflection), turning)
    return np.asarray(np.sqrt(eigh(stiffness, mass, eigvals_only=True)[:modes]) / (2 * np.pi))
