"""How far turnbuckles move the frequencies of a hanger off the pattern of a uniform bar."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from shm.identify.placing.pattern import tensioned_beam_pattern
from shm.values import FloatArray, Hanger

_SECTIONS = 1201
_SPRING = 2


def turnbuckle_shift(hanger: Hanger) -> tuple[float, ...]:
    """Log of the frequency of each order beside that of the uniform bar; empty without turnbuckles.

    By the Rayleigh-Ritz method (R. W. Clough and J. Penzien, Dynamics of Structures, 1993, 8-6)
    on the modes of the bar at nominal tension and half fixity. Across a stiff turnbuckle the
    bending moment goes on, across a soft one the curvature.
    """
    if not hanger.turnbuckles:
        return ()
    pattern = tensioned_beam_pattern()
    xi = hanger.length_m * np.sqrt(hanger.nominal_tension_n / hanger.bending_stiffness_n_m2)
    tension = int(np.argmin(np.abs(pattern.log_xi - np.log(xi))))
    place = np.linspace(0, 1, _SECTIONS)
    shape = pattern.shapes(place, np.array([tension]))[0, _SPRING]
    shape = shape / np.sqrt(np.mean(shape**2, axis=1, keepdims=True))
    curvature = np.gradient(np.gradient(shape, place, axis=1), place, axis=1)
    added_mass, added_stiffness = _along(hanger, place)
    squares = (pattern.alpha[tension, _SPRING] * pattern.beta[tension, _SPRING]) ** 2
    mass = np.eye(len(shape)) + (shape * added_mass) @ shape.T / _SECTIONS
    stiffness = np.diag(squares) + (curvature * added_stiffness) @ curvature.T / _SECTIONS
    moved = eigh(stiffness, mass, eigvals_only=True)
    return tuple((np.log(np.maximum(moved, squares / 4) / squares) / 2).tolist())


def _along(hanger: Hanger, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Added mass and bending stiffness along the hanger, in those of the bar."""
    mass, stiffness = np.zeros_like(place), np.zeros_like(place)
    for each in hanger.turnbuckles:
        inside = np.abs(place * hanger.length_m - each.x_m) <= each.length_m / 2
        mass[inside] = each.mass_kg / each.length_m / hanger.mass_per_length_kg_m - 1
        ratio = each.bending_stiffness_n_m2 / hanger.bending_stiffness_n_m2
        stiffness[inside] = 1 - 1 / ratio if ratio > 1 else ratio - 1
    return mass, stiffness
