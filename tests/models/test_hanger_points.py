"""Masses and springs at a place: transcendental equations and fine elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.hanger import LateralSpring, PointMass
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    MASS,
    TENSION,
    clamped,
    elements_hz,
    frequencies_hz,
)

BAR_KG = MASS * LENGTH


def mass(x_m: float, kg: float, rows: int = 1) -> PointMass:
    return PointMass(np.full(rows, x_m), np.full(rows, kg))


def spring(x_m: float, n_m: float, rows: int = 1) -> LateralSpring:
    return LateralSpring(np.full(rows, x_m), np.full((rows, 2), n_m), np.zeros(rows))


@pytest.mark.parametrize("share", [0.001, 0.03, 0.2])
@pytest.mark.parametrize("x_m", [0.1, 3.6, 6.0])
def test_a_clamped_mass_agrees_with_fine_elements(share: float, x_m: float) -> None:
    kg = share * BAR_KG
    expected = elements_hz(lambda x: EI, lambda x: MASS, [], 8, masses=[(x_m, kg)])
    found = frequencies_hz(replace(clamped(), masses=(mass(x_m, kg),)), 8)[0, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize("stiffness", [0.001, 1.0, 100.0])
@pytest.mark.parametrize("x_m", [0.4, 5.0])
def test_a_lateral_spring_agrees_with_fine_elements(stiffness: float, x_m: float) -> None:
    n_m = stiffness * TENSION / LENGTH
    expected = elements_hz(lambda x: EI, lambda x: MASS, [], 8, springs=[(x_m, n_m)])
    found = frequencies_hz(replace(clamped(), springs=(spring(x_m, n_m),)), 8)[0, 0]
    np.testing.assert_allclose(found, expected, rtol=2e-5)
