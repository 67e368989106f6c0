"""The beam elements against closed forms.

A beam of tension T, bending stiffness EI and mass m per length has w^2 m = EI b^4 + T b^2 for a
wave number b, and beside it the decaying wave number a with a^2 = b^2 + T/EI.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.simulate import HangerState
from shm.values import FloatArray, Hanger
from tests.worlds.simulated.elements import natural_frequencies, plane_modes

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

MODES = 10


def frequency(hanger: Hanger, tension: float, wave_number: FloatArray | float) -> FloatArray:
    b = np.asarray(wave_number)
    square = (hanger.bending_stiffness_n_m2 * b**4 + tension * b**2) / hanger.mass_per_length_kg_m
    return np.sqrt(square) / (2 * np.pi)


def on_springs(hanger: Hanger, tension: float, k: float, modes: int) -> FloatArray:
    """Symmetric springs k at both ends: half a beam in even and odd shapes, b from each.

    About the middle, w = cos(b x) - cos(b h) cosh(a x)/cosh(a h) for even and the same with sines
    for odd shapes, h half the length; EI w'' = -k w' at x = h (moment against rotation).
    """
    h, bending = hanger.length_m / 2, hanger.bending_stiffness_n_m2

    def moment(b: float, odd: bool) -> float:
        a = math.sqrt(b * b + tension / bending)
        c, s = (math.sin(b * h), math.cos(b * h)) if odd else (math.cos(b * h), -math.sin(b * h))
        t = 1 / math.tanh(a * h) if odd else math.tanh(a * h)
        slope, curvature = b * s - a * t * c, -(b * b + a * a) * c
        return slope + bending * curvature / k if k else curvature

    found = [
        brentq(moment, (n * np.pi + 1e-9) / (2 * h), ((n + 1) * np.pi - 1e-9) / (2 * h),
               args=(n % 2 == 0,), xtol=1e-15, rtol=1e-14)
        for n in range(1, modes + 1)
    ]  # fmt: skip
    return frequency(hanger, tension, np.array(found))


@pytest.mark.parametrize("tension", [-1e5, 0.0, 711e3, 1e8, 1.9e10])
def test_a_pinned_hanger_has_the_frequencies_of_the_closed_form(
    hanger: Hanger, tension: float
) -> None:
    """f_n = n/(2L) sqrt(T/m) sqrt(1 + n^2 pi^2 EI/(T L^2)) is exact."""
    found = natural_frequencies(hanger, HangerState(tension, 0, 0, 0, 0), MODES)
    exact = frequency(hanger, tension, np.arange(1, MODES + 1) * np.pi / hanger.length_m)
    np.testing.assert_allclose(found, [exact, exact], rtol=1e-6)


@pytest.mark.parametrize("tension", [711e3, 2e7, 1.9e10])
@pytest.mark.parametrize("k", [1e4, 1e7, 1e10, 1e15, math.inf])
def test_end_springs_agree_with_the_transcendental_equation(
    hanger: Hanger, tension: float, k: float
) -> None:
    found = natural_frequencies(hanger, HangerState(tension, k, k, k, k), MODES)
    exact = on_springs(hanger, tension, k, MODES)
    np.testing.assert_allclose(found, [exact, exact], rtol=1e-6)


def test_k1_and_k3_act_transversely_and_k2_and_k4_longitudinally(hanger: Hanger) -> None:
    clamped = natural_frequencies(hanger, HangerState(711e3), 2)
    for softened, plane in (("k1", 0), ("k2", 1), ("k3", 0), ("k4", 1)):
        state = HangerState(711e3, **{f"{softened}_n_m_rad": 1e6})
        change = natural_frequencies(hanger, state, 2) / clamped - 1
        assert np.all(change[plane] < -0.01)
        np.testing.assert_allclose(change[1 - plane], 0, atol=1e-9)


def test_shapes_between_the_nodes_are_mass_normalised_sines_of_a_pinned_hanger(
    hanger: Hanger,
) -> None:
    x = np.linspace(0, hanger.length_m, 57)
    shapes = plane_modes(hanger, HangerState(711e3, 0, 0, 0, 0), "longitudinal", 3).at(x)
    amplitude = math.sqrt(2 / (hanger.mass_per_length_kg_m * hanger.length_m))
    exact = amplitude * np.sin(np.outer(x, np.arange(1, 4)) * np.pi / hanger.length_m)
    np.testing.assert_allclose(np.abs(shapes), np.abs(exact), atol=1e-6 * amplitude)
