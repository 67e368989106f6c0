"""The fine elements against closed forms: a bar that shears, sags, and moves with its ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.simulate import HangerState
from shm.values import FloatArray, Hanger, Turnbuckle
from tests.worlds.simulated.bar.description import Bar, bar_of
from tests.worlds.simulated.bar.modes import bar_modes
from tests.worlds.simulated.elements import natural_frequencies

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

PLACES = (1.56, 3.48, 5.4, 7.92)
PINNED = HangerState(711e3, 0, 0, 0, 0)


def frequencies(bar: Bar, modes: int = 8, refined: int = 1) -> FloatArray:
    found = bar_modes(bar, modes, PLACES, refined=refined)
    return np.array([own.angular_frequency_rad_s for own in found]) / (2 * np.pi)


def sheared(hanger: Hanger, state: HangerState) -> Bar:
    rigidity = 0.886 * hanger.elastic_modulus_pa / 2.6 * hanger.area_m2
    return replace(
        bar_of(hanger, state),
        shear_compliance_1_n=1 / rigidity,
        rotary_inertia_kg_m=7800 * hanger.second_moment_m4,
    )


@pytest.mark.parametrize("tension", [711e3, 2e7])
@pytest.mark.parametrize("k", [0.0, 1e7, math.inf])
def test_without_effects_they_agree_with_the_hermite_elements(
    hanger: Hanger, tension: float, k: float
) -> None:
    state = HangerState(tension, k, 2 * k, k, 3 * k)
    np.testing.assert_allclose(
        frequencies(bar_of(hanger, state)), natural_frequencies(hanger, state, 8), rtol=1e-6
    )


def test_turnbuckles_agree_with_the_hermite_elements(hanger: Hanger) -> None:
    buckled = replace(
        hanger, turnbuckles=(Turnbuckle(2.0, 0.6, 90.0, 9e6), Turnbuckle(9.0, 0.5, 70.0, 8e6))
    )
    for state in (HangerState(711e3, k1_n_m_rad=1e7), HangerState(711e3, length_m=11.5)):
        np.testing.assert_allclose(
            frequencies(bar_of(buckled, state)), natural_frequencies(buckled, state, 8), rtol=2e-6
        )


def test_a_pinned_timoshenko_bar_in_tension_has_the_frequencies_of_its_sine(
    hanger: Hanger,
) -> None:
    """w = W sin(kx) and a rotation S cos(kx) solve it: for each k a problem of two unknowns.

    Stiffness [[(Q + T) k^2, -Q k], [-Q k, EI k^2 + Q]], Q = kappa G A, mass diag(m, rho I).
    """
    bar = sheared(hanger, PINNED)
    shear, bending = 1 / bar.shear_compliance_1_n, hanger.bending_stiffness_n_m2
    exact = []
    for k in np.arange(1, 9) * np.pi / hanger.length_m:
        stiffness = np.array(
            [[(shear + 711e3) * k**2, -shear * k], [-shear * k, bending * k**2 + shear]]
        )
        mass = np.array([hanger.mass_per_length_kg_m, bar.rotary_inertia_kg_m])
        exact.append(np.sqrt(np.linalg.eigvals(stiffness / mass[:, None]).min()) / (2 * np.pi))
    np.testing.assert_allclose(frequencies(bar), [exact, exact], rtol=5e-6)


def test_a_sagging_string_obeys_irvines_equation(hanger: Hanger) -> None:
    """Symmetric modes: tan(W/2) = W/2 - 4/lambda^2 (W/2)^3, W = omega L sqrt(m/T)."""
    string = replace(hanger, second_moment_m4=hanger.second_moment_m4 * 1e-7)
    bar = replace(bar_of(string, PINNED), sag_parameter=(12.0, 0.0))
    found = frequencies(bar, 3)
    scale = 2 * np.pi * hanger.length_m * math.sqrt(hanger.mass_per_length_kg_m / 711e3)
    exact = 2 * brentq(lambda v: math.tan(v) - v + 4 / 12.0 * v**3, 1.58, 3.1)
    assert found[0, 0] * scale == pytest.approx(exact, rel=1e-5)
    np.testing.assert_allclose(found[0, 1] * scale, 2 * np.pi, rtol=1e-5)
    np.testing.assert_allclose(found[1] * scale, np.pi * np.arange(1, 4), rtol=1e-5)


@pytest.mark.parametrize("spring", [2e5, 5e6])
def test_ends_that_move_but_do_not_turn_obey_their_equation(hanger: Hanger, spring: float) -> None:
    """About the middle w = cos(bx) + c cosh(ax); at x = h the slope is 0 and EI w''' = k w.

    b is the wave number of the lowest mode and a^2 = b^2 + T/EI.
    """
    h, bending = hanger.length_m / 2, hanger.bending_stiffness_n_m2

    def force(b: float) -> float:
        a = math.sqrt(b * b + 711e3 / bending)
        c = b * math.sin(b * h) / (a * math.sinh(a * h))
        third = b**3 * math.sin(b * h) + c * a**3 * math.sinh(a * h)
        return bending * third - spring * (math.cos(b * h) + c * math.cosh(a * h))

    b = brentq(force, 1e-6, math.pi / h)
    square = (bending * b**4 + 711e3 * b**2) / hanger.mass_per_length_kg_m
    bar = bar_of(hanger, HangerState(711e3))
    for end in (0, 1):
        bar = bar.with_end(end, replace(bar.ends[end], held_n_m=(spring, math.inf)))
    assert frequencies(bar)[0, 0] == pytest.approx(math.sqrt(square) / (2 * np.pi), rel=1e-6)


def test_equal_planes_that_an_end_couples_split_along_its_axis(hanger: Hanger) -> None:
    """Compliance a a^T/k: bending along a has the spring, bending across it is clamped."""
    angle, k = math.radians(30), 1e7
    bar = bar_of(hanger, HangerState(711e3))
    compliance = np.outer(*2 * ([math.cos(angle), math.sin(angle)],)) / k
    end = replace(
        bar.ends[0],
        turning_rad_n_m=(compliance[0, 0], compliance[1, 1]),
        cross_rad_n_m=compliance[0, 1],
    )
    found = bar_modes(bar.with_end(0, end), 8, PLACES)
    sprung = natural_frequencies(hanger, HangerState(711e3, k1_n_m_rad=k), 8)
    np.testing.assert_allclose(
        [own.angular_frequency_rad_s / (2 * np.pi) for own in found], sprung, rtol=2e-6
    )
    transverse, longitudinal = (own.at(PLACES) for own in found)
    np.testing.assert_allclose(transverse[:, 1], math.tan(angle) * transverse[:, 0], atol=1e-6)
    np.testing.assert_allclose(longitudinal[:, 0], -math.tan(angle) * longitudinal[:, 1], atol=1e-6)
