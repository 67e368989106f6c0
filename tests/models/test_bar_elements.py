"""Compare elements of high degree with closed forms, a rigid link and a hanging string."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from shm.models import tensioned_beam
from shm.models.bar_elements import BarElements, bar_elements
from shm.values import FloatArray

SLENDERNESS = (0.5, 3.0, 20.0, 150.0)
ENDS = ((0.0, 0.0), (0.3, 40.0), (0.0, 1e6), (1e6, 1e6))
MODES = 8


def circular_frequencies(
    elements: BarElements,
    tension: float,
    ends: tuple[float, float] = (0.0, 0.0),
    zone: tuple[float, float] = (1.0, 1.0),
    shear: float = np.nan,
    turning: float = 0.0,
) -> FloatArray:
    """Return omega (MODES,) in units of sqrt(EI/m)/L2; `zone` are factors of the first zone."""
    stiffness = elements.bending[0] + tension * elements.tension
    mass = elements.mass[0] + turning * elements.turning[0]
    for stiffer, heavier, bending, weight in zip(
        zone[:1], zone[1:], elements.bending[1:], elements.mass[1:], strict=False
    ):
        stiffness, mass = stiffness + stiffer * bending, mass + heavier * weight
    for spring, rotation in zip(ends, elements.end_rotation, strict=True):
        stiffness = stiffness + spring * np.outer(rotation, rotation)
    if elements.shear.size:
        stiffness = stiffness + shear * elements.shear
    # Of the inverse the lowest modes are the largest values: stiff springs round nothing away.
    return np.asarray(eigh(mass, stiffness, eigvals_only=True)[::-1][:MODES] ** -0.5)


@pytest.mark.parametrize("xi", SLENDERNESS)
@pytest.mark.parametrize("ends", ENDS)
def test_a_bar_on_springs_has_the_frequencies_of_its_closed_form(
    xi: float, ends: tuple[float, float]
) -> None:
    found = circular_frequencies(bar_elements([], xi, MODES, False), xi**2, ends)
    bar = map(np.array, (1.0, xi**2, 1.0, 1.0, *ends))
    expected = 2 * np.pi * tensioned_beam.frequencies_hz(*bar, MODES)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("xi", SLENDERNESS)
@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("gyration", [0.002, 0.01])
def test_a_bar_that_shears_has_the_frequencies_of_its_closed_form(
    xi: float, ends: tuple[float, float], gyration: float
) -> None:
    """Take a third of E A as shear stiffness, about that of steel."""
    shear, turning = 1 / (3 * gyration**2), gyration**2
    elements = bar_elements([], xi, MODES, True)
    found = circular_frequencies(elements, xi**2, ends, shear=shear, turning=turning)
    bar = map(np.array, (1.0, xi**2, 1.0, 1.0, *ends))
    section = map(np.array, (1 / shear, gyration))
    expected = 2 * np.pi * tensioned_beam.frequencies_hz(*bar, MODES, *section)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def link_and_bar(tension: float, link: float, heavier: float, modes: int) -> FloatArray:
    """Return omega (modes,) of a bar hinged at its end, whose start a hinged rigid link holds.

    Where link and bar meet, w = a w' and w'' = a w''' - omega2 J w', of the link's moment of
    inertia J = mu a3/3: the tension's moments in link and bar cancel.
    """
    span, inertia = 1 - link, heavier * link**3 / 3

    def determinant(omega: float) -> float:
        q2 = np.sqrt(tension**2 / 4 + omega**2) - tension / 2
        q, p = np.sqrt(q2), np.sqrt(q2 + tension)
        # w = A sin q(l - s) + B sinh p(l - s)/cosh pl vanishes with its moment at the far end.
        sin, cos, tanh = np.sin(q * span), np.cos(q * span), np.tanh(p * span)
        values = ((sin, -q * cos, -(q**2) * sin, q**3 * cos), (tanh, -p, p**2 * tanh, -(p**3)))
        rows = [
            [w - link * slope, bend - link * force + omega**2 * inertia * slope]
            for w, slope, bend, force in values
        ]
        return float(np.linalg.det(rows))

    grid = np.linspace(1e-3, 1.3 * modes * np.pi * np.hypot(np.sqrt(tension), modes * np.pi), 4000)
    signs = np.sign([determinant(omega) for omega in grid])
    at = np.flatnonzero(signs[1:] != signs[:-1])[:modes]
    return np.array([brentq(determinant, grid[k], grid[k + 1], xtol=1e-10) for k in at])


@pytest.mark.parametrize("tension", [1.0, 60.0, 2500.0])
def test_a_nearly_rigid_zone_at_a_hinge_is_a_rigid_link(tension: float) -> None:
    link, heavier = 0.08, 3.0
    elements = bar_elements([(0.0, link)], np.sqrt(tension), MODES, False)
    found = circular_frequencies(elements, tension, zone=(1e7, heavier))
    expected = link_and_bar(tension, link, heavier, MODES)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    soft = circular_frequencies(elements, tension, zone=(1.0, heavier))
    assert np.abs(soft / expected - 1).max() > 0.01


@pytest.mark.parametrize("gradient", [0.0, 150.0, -300.0])
def test_a_hanging_string_has_the_frequencies_of_its_equation(gradient: float) -> None:
    """(T w')' = - omega2 w of T = T0 + g (x - 1/2), by finite differences of the second order."""
    tension, count = 1e5, 600
    steep = 400 * gradient  # bending is felt by 3e-3
    elements = bar_elements([], np.sqrt(tension), 4, False)
    stiffness = elements.bending[0] + tension * elements.tension + steep * elements.gradient
    found = np.sqrt(eigh(stiffness, elements.mass[0], eigvals_only=True)[:3])
    middles = (np.arange(count) + 0.5) / count
    pull = (tension + steep * (middles - 0.5)) * count**2
    difference = np.diag(pull[1:] + pull[:-1]) - np.diag(pull[1:-1], 1) - np.diag(pull[1:-1], -1)
    expected = np.sqrt(eigh(difference, eigvals_only=True, subset_by_index=[0, 2]))
    np.testing.assert_allclose(found, expected, rtol=2e-3)
