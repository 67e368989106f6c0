"""The bar of the road bridge's world against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jv, yv

from tests.worlds.tensioned_bars import GRAVITY, PLANES, Bar, Plane, Stretch

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

ROUND = Bar(
    length_m=8.0,
    modulus_pa=205e9,
    area_m2=np.pi * 0.06**2 / 4,
    second_moment_m4=np.pi * 0.06**4 / 64,
    mass_kg_m=7850 * np.pi * 0.06**2 / 4,
    shear_area_m2=0.886 * np.pi * 0.06**2 / 4,
    inclination_deg=90.0,
)
WIRE = replace(ROUND, second_moment_m4=1e-14, shear_area_m2=1.0)
CLAMPED = (1e10, 1e10)
HINGED = (0.0, 0.0)


def _weightless(bar: Bar, plane: str = "transverse") -> Plane:
    """Make the matrices of a bar that hangs level: its tension does not grow."""
    return Plane(replace(bar, inclination_deg=0.0), plane)


def test_a_hinged_thick_bar_has_the_timoshenko_frequency() -> None:
    thick = replace(ROUND, length_m=0.6)
    found = _weightless(thick).solve(0.0, HINGED, count=2)
    shear = thick.modulus_pa / 2.6 * thick.shear_area_m2
    for order, frequency in enumerate(found, 1):
        k = order * np.pi / thick.length_m
        turning = thick.mass_kg_m * thick.second_moment_m4 / thick.area_m2
        bending = thick.bending_nm2
        stiffness = np.array([[shear * k**2, -shear * k], [-shear * k, shear + bending * k**2]])
        squared = np.linalg.eigvals(np.diag([1 / thick.mass_kg_m, 1 / turning]) @ stiffness).min()
        assert frequency == pytest.approx(np.sqrt(squared) / (2 * np.pi), rel=1e-4)


def test_a_taut_clamped_bar_has_the_frequency_of_morse() -> None:
    slender = replace(ROUND, shear_area_m2=1e3, area_m2=1e3, length_m=20.0, elements=120)
    tension = 600e3
    found = _weightless(slender).solve(tension, CLAMPED, count=1)[0]
    taut = 20.0 * np.sqrt(tension / slender.bending_nm2)
    # Morse, Vibration and Sound (1948), a stiff string between clamps, to the second order.
    higher = 1 + 2 / taut + (4 + np.pi**2 / 2) / taut**2
    assert found == pytest.approx(higher * np.sqrt(tension / slender.mass_kg_m) / 40, rel=5e-4)
    assert found > _weightless(slender).solve(tension, HINGED, count=1)[0]


def test_springs_of_a_bar_in_static_bending_are_exact() -> None:
    slender = replace(ROUND, shear_area_m2=1e3, area_m2=1e3)
    spring = 5e4
    found = _weightless(slender).solve(0.0, (spring, spring), count=1)[0]
    length, bending = slender.length_m, slender.bending_nm2

    def symmetric(x: float) -> float:
        # cos and cosh about the middle: w = 0 and EI w'' = -k w' at the end.
        half = x / 2
        return float(
            2 * bending / length * half * np.cos(half) * np.cosh(half) * 2
            + spring * (np.sin(half) * np.cosh(half) + np.cos(half) * np.sinh(half))
        )

    root = brentq(symmetric, np.pi * 1.0001, 4.73004)
    wanted = root**2 / length**2 * np.sqrt(bending / slender.mass_kg_m) / (2 * np.pi)
    assert found == pytest.approx(wanted, rel=3e-5)


def test_own_weight_of_a_wire_gives_the_hanging_chains_bessel_functions() -> None:
    middle = 4000.0
    weight = WIRE.mass_kg_m * GRAVITY
    low, high = middle - weight * 4, middle + weight * 4
    found = Plane(replace(WIRE, elements=200), "transverse").solve(middle, HINGED, count=2)

    def closed(frequency: float) -> float:
        scale = 2 * np.pi * frequency * 2 * np.sqrt(WIRE.mass_kg_m) / weight
        a, b = scale * np.sqrt(low), scale * np.sqrt(high)
        return float(jv(0, a) * yv(0, b) - jv(0, b) * yv(0, a))

    even = np.sqrt(middle / WIRE.mass_kg_m) / (2 * 8.0)
    first = brentq(closed, 0.9 * even, 1.1 * even)
    assert found[0] == pytest.approx(first, rel=2e-4)
    assert abs(found[0] / even - 1) > 1e-3  # else the weight was not tried


def test_sag_raises_the_first_mode_by_irvines_parameter() -> None:
    leaning = replace(WIRE, length_m=20.0, inclination_deg=60.0, elements=100)
    tension = 80e3
    across, along = (Plane(leaning, each).solve(tension, HINGED, count=2) for each in PLANES)
    # Irvine: tan(x/2) = x/2 - 4/lambda2 (x/2)^3 with x = omega L sqrt(m/T), for a shallow curve.
    weight = leaning.mass_kg_m * GRAVITY * np.cos(np.deg2rad(60))
    stiffness = leaning.modulus_pa * leaning.area_m2
    lambda2 = (weight * 20.0 / tension) ** 2 * stiffness / tension
    half = brentq(lambda h: np.sin(h) - np.cos(h) * (h - 4 / lambda2 * h**3), 1.5708, 4.4)
    assert lambda2 > 0.1
    wanted = 2 * half / np.pi
    assert along[0] / across[0] == pytest.approx(wanted, rel=1e-3)
    assert along[1] == pytest.approx(across[1], rel=1e-3)


def test_a_stiff_fitting_shortens_and_its_mass_slows() -> None:
    fitting = Stretch(0.0, 0.5, bending=(1e4, 1e4), mass=1.0)
    plain, stiff = (
        _weightless(each).solve(2e5, CLAMPED, count=1)[0]
        for each in (ROUND, ROUND.with_stretch(fitting))
    )
    shorter = _weightless(replace(ROUND, length_m=7.5)).solve(2e5, CLAMPED, count=1)[0]
    assert stiff == pytest.approx(shorter, rel=2e-3)
    heavy = _weightless(ROUND.with_stretch(replace(fitting, from_m=3.5, to_m=4.5, mass=4.0)))
    light = _weightless(ROUND.with_stretch(replace(fitting, from_m=3.5, to_m=4.5)))
    assert heavy.solve(2e5, HINGED)[0] < light.solve(2e5, HINGED)[0]
    assert plain < stiff
