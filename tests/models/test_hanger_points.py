"""Masses and springs at a place: transcendental equations and fine elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.models.hanger import LateralSpring, PointMass
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    MASS,
    TENSION,
    clamped,
    elements_hz,
    frequencies_hz,
    of_slenderness,
    on_springs,
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


def string(xi: float = 1e3):
    """A pinned bar of next to no bending stiffness: f_n = n/(2L) sqrt(T/m) (1 + n^2 pi^2/xi^2)."""
    loose = np.zeros((1, 2))
    return on_springs(of_slenderness(np.array([xi])), loose, loose)


def test_a_mass_in_the_middle_of_a_string() -> None:
    """Half-length h, wave number k, mass M: cot(k h) = k M/(2 m) for odd, k h = n pi for even."""
    h, kg = LENGTH / 2, 0.05 * BAR_KG

    def fault(k: float) -> float:
        return float(np.cos(k * h) - k * kg / (2 * MASS) * np.sin(k * h))

    odd = [brentq(fault, (n * np.pi + 1e-9) / h, (n + 1) * np.pi / h) for n in range(3)]
    waves = np.sort([*odd, *(np.arange(1, 4) * np.pi / h)])
    found = frequencies_hz(replace(string(), masses=(mass(h, kg),)), 6)[0, 0]
    expected = waves * np.sqrt(TENSION / MASS) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_a_spring_in_the_middle_of_a_string() -> None:
    """Half-length h, spring s: tan(k h) = -2 T k/s for odd modes, k h = n pi for even ones."""
    h, n_m = LENGTH / 2, 5 * TENSION / LENGTH

    def fault(k: float) -> float:
        return float(np.sin(k * h) * n_m + 2 * TENSION * k * np.cos(k * h))

    odd = [brentq(fault, (n + 0.5) * np.pi / h, (n + 1) * np.pi / h) for n in range(3)]
    waves = np.sort([*odd, *(np.arange(1, 4) * np.pi / h)])
    found = frequencies_hz(replace(string(), springs=(spring(h, n_m),)), 6)[0, 0]
    expected = waves * np.sqrt(TENSION / MASS) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_a_rigid_spring_in_the_middle_halves_the_bar() -> None:
    """Odd modes become those of a half, clamped and clamped by symmetry; even ones stay."""
    free = frequencies_hz(clamped(), 8)[0, 0]
    held = frequencies_hz(replace(clamped(), springs=(spring(6.0, 1e15),)), 8)[0, 0]
    half = replace(clamped(), arch_end_m=np.array([6.0]))
    np.testing.assert_allclose(held[1::2], frequencies_hz(half, 4)[0, 0], rtol=1e-4)
    np.testing.assert_allclose(held[::2], free[1::2], rtol=1e-4)


def test_a_spring_in_one_plane_leaves_the_other_alone() -> None:
    one = LateralSpring(np.array([4.0]), np.array([[3e5, 0.0]]), np.zeros(1))
    found = frequencies_hz(replace(clamped(), springs=(one,)), 6)[0]
    plain = frequencies_hz(clamped(), 6)[0]
    np.testing.assert_allclose(found[1], plain[1], rtol=1e-6)
    assert np.all(found[0] > plain[0])


def test_masses_at_ends_beyond_them_or_of_nothing_change_nothing() -> None:
    for each in (mass(0.0, 50), mass(12.0, 50), mass(-3.0, 50), mass(15.0, 50), mass(4.0, 0)):
        found = frequencies_hz(replace(clamped(), masses=(each,)), 8)
        np.testing.assert_allclose(found, frequencies_hz(clamped(), 8), rtol=1e-6)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6, 1e-3, 0.05])
def test_masses_at_nearly_one_place_are_one_mass(apart: float) -> None:
    pair = (mass(4.0 - apart / 2, 15), mass(4.0 + apart / 2, 25), mass(4.0 + apart / 2, 0.0))
    found = frequencies_hz(replace(clamped(), masses=pair), 8)
    single = frequencies_hz(replace(clamped(), masses=(mass(4.0, 40),)), 8)
    np.testing.assert_allclose(found, single, rtol=2e-5 + 0.02 * apart)


def test_the_answer_does_not_jump_where_a_mass_grows_heavy() -> None:
    """Below a share of 0.002 no kink is added for it."""
    shares = np.array([0.00199, 0.00201])
    rows = [
        frequencies_hz(replace(clamped(), masses=(mass(5.0, share * BAR_KG),)), 8)[0, 0]
        for share in shares
    ]
    slope = (rows[1] / rows[0] - 1) / (shares[1] - shares[0])
    assert np.all(np.abs(slope) < 1.1)


def test_a_light_mass_lowers_each_mode_by_its_share_of_the_kinetic_energy() -> None:
    """Rayleigh: df/f = -M w(x)^2/(2 m int w^2), and w of a clamped bar by elements at hand: the sum
    over two masses is the sum of their effects."""
    light = 1e-6 * BAR_KG
    plain = frequencies_hz(clamped(), 8)
    one, other = (
        frequencies_hz(replace(clamped(), masses=(mass(x, light),)), 8) / plain - 1
        for x in (3.0, 7.7)
    )
    both = frequencies_hz(replace(clamped(), masses=(mass(3.0, light), mass(7.7, light))), 8)
    np.testing.assert_allclose(both / plain - 1, one + other, rtol=1e-3, atol=1e-12)
    assert np.all(one <= 0)
