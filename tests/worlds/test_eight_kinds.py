"""The proof of the world of eight kinds: closed forms first, then the population it draws."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0, y0

from tests.worlds.eight_kinds import (
    KINDS,
    PLANES,
    POISSON,
    Case,
    Design,
    Draws,
    Member,
    Tolerances,
    Zone,
    cowper,
    describe,
    make_members,
    natural_frequencies_hz,
    sound_hangers,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

D, L = 0.08, 8.0
AREA, SECOND = math.pi * D**2 / 4, math.pi * D**4 / 64
EI, EA, M = 205e9 * SECOND, 205e9 * AREA, 7850 * AREA
PINNED = Member(L, 3e5, EI, M)
STRING = Member(L, 3e5, 1e-3, M)
ORDERS = np.arange(1, 9)


def _root_near(function: Callable[[float], float], value: float) -> float:
    """Return the root within 0.5 % of a value; without a change of sign there, fail."""
    return float(brentq(function, 0.995 * value, 1.005 * value, xtol=1e-12 * value))


def _wave_numbers(omega: float, tension_n: float) -> tuple[float, float]:
    """Return the trigonometric and the hyperbolic wave number of a tensioned Euler beam."""
    half, inertia = tension_n / EI / 2, M * omega**2 / EI
    root = math.sqrt(half**2 + inertia)
    return math.sqrt(root - half), math.sqrt(root + half)


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("tension_n", [1e3, 3e5, 3e6])
def test_clamped_bar_under_tension(tension_n: float) -> None:
    """Even about mid-length: a tan(aL/2) + b tanh(bL/2) = 0; odd: b tan(aL/2) = a tanh(bL/2)."""

    def even(omega: float) -> float:
        a, b = _wave_numbers(omega, tension_n)
        return a * math.sin(a * L / 2) + b * math.tanh(b * L / 2) * math.cos(a * L / 2)

    def odd(omega: float) -> float:
        a, b = _wave_numbers(omega, tension_n)
        return b * math.sin(a * L / 2) - a * math.tanh(b * L / 2) * math.cos(a * L / 2)

    clamped = replace(PINNED, tension_n=tension_n, rotation_n_m_rad=(math.inf, math.inf))
    for i, found in enumerate(2 * math.pi * natural_frequencies_hz(clamped, 8)):
        assert found == pytest.approx(_root_near((even, odd)[i % 2], found), rel=2e-6)
    stiff = replace(clamped, rotation_n_m_rad=(1e6 * EI / L, 1e6 * EI / L))
    springs, constraints = natural_frequencies_hz(stiff, 8), natural_frequencies_hz(clamped, 8)
    np.testing.assert_allclose(springs, constraints, rtol=1e-5)


@pytest.mark.parametrize("stiffness", [0.5, 10.0])
def test_end_springs_under_tension(stiffness: float) -> None:
    """Even modes w = cos as / cos(aL/2) - cosh bs / cosh(bL/2); EI w'' + k w' = 0 at the end."""
    tension_n, spring = PINNED.tension_n, stiffness * EI / L

    def moment(omega: float) -> float:
        a, b = _wave_numbers(omega, tension_n)
        slope = a * math.sin(a * L / 2) + b * math.tanh(b * L / 2) * math.cos(a * L / 2)
        return EI * (a**2 + b**2) * math.cos(a * L / 2) + spring * slope

    found = natural_frequencies_hz(replace(PINNED, rotation_n_m_rad=(spring, spring)), 7)
    for omega in 2 * math.pi * found[::2]:
        assert omega == pytest.approx(_root_near(moment, omega), rel=2e-6)


@pytest.mark.parametrize("tension_n", [0.0, 1e6])
@pytest.mark.parametrize("coefficient", [cowper(0.0), cowper(0.95)])
def test_pinned_timoshenko_bar(tension_n: float, coefficient: float) -> None:
    """w = sin kx, rotation = r cos kx reduce the equations to two by two for each k, exactly."""
    shear, inertia = coefficient * EA / (2 * (1 + POISSON)), 7850 * SECOND
    expected = []
    for k in ORDERS * math.pi / L:
        stiffness = [[(shear + tension_n) * k**2, -shear * k], [-shear * k, EI * k**2 + shear]]
        scale = np.diag([M**-0.5, inertia**-0.5])
        expected.append(math.sqrt(np.linalg.eigvalsh(scale @ stiffness @ scale)[0]) / 2 / math.pi)
    thick = replace(
        PINNED, tension_n=tension_n, shear_stiffness_n=shear, rotary_inertia_kg_m=inertia
    )
    np.testing.assert_allclose(natural_frequencies_hz(thick, 8), expected, rtol=4e-6)
    np.testing.assert_allclose(natural_frequencies_hz(thick, 8, 1200), expected, rtol=1e-6)
    thin = natural_frequencies_hz(replace(thick, shear_stiffness_n=math.inf), 8)
    assert np.all(thin > np.array(expected))


@pytest.mark.parametrize("irvine", [0.5, 5.0, 30.0, 60.0, 500.0])
def test_sagging_string(irvine: float) -> None:
    """Irvine: tan z = z - 4 z^3 / lambda^2, z = omega L sqrt(m/T) / 2; odd modes do not feel it."""
    tension_n, gravity = STRING.tension_n, 9.81
    axial = irvine * tension_n**3 / (M * gravity * L) ** 2
    sagging = replace(STRING, axial_stiffness_n=axial, gravity_across_m_s2=gravity)

    def symmetric(z: float) -> float:
        return math.sin(z) - (z - 4 * z**3 / irvine) * math.cos(z)

    # One symmetric mode in each half turn above pi/2 (Irvine, figure 3.5).
    roots = [
        brentq(symmetric, (n + 0.5) * math.pi + 1e-9, (n + 1.5) * math.pi - 1e-9) for n in range(3)
    ]
    assert (roots[0] < math.pi) == (irvine < 4 * math.pi**2)  # Irvine's crossover
    expected = sorted([*roots, math.pi, 2 * math.pi])[:4]
    z = math.pi * L * math.sqrt(M / tension_n) * natural_frequencies_hz(sagging, 4)
    np.testing.assert_allclose(z, expected, rtol=3e-5)


def test_hanging_string() -> None:
    """A vertical string: with s = T/(m g), w = A J0(2 omega sqrt(s/g)) + B Y0(the same)."""
    gravity = 9.81
    weight = M * gravity
    tension_n = 0.7 * weight * L  # at mid-length; a fifth of the weight at the deck
    low, high = tension_n / weight - L / 2, tension_n / weight + L / 2

    def both_ends(omega: float) -> float:
        one, two = (2 * omega * math.sqrt(s / gravity) for s in (low, high))
        return float(j0(one) * y0(two) - j0(two) * y0(one))

    hanging = replace(STRING, tension_n=tension_n, gravity_along_m_s2=gravity)
    uniform = natural_frequencies_hz(replace(hanging, gravity_along_m_s2=0.0), 4)
    for found, without in zip(natural_frequencies_hz(hanging, 4), uniform, strict=True):
        omega = 2 * math.pi * found
        assert omega == pytest.approx(_root_near(both_ends, omega), rel=2e-4)
        assert found < 0.98 * without


@pytest.mark.parametrize("mass_factor", [1.0, 6.0])
@pytest.mark.parametrize("tension_n", [1e4, 1e6])
def test_hinged_rigid_zones(mass_factor: float, tension_n: float) -> None:
    """A rigid link on a pin at each end: w' = w/a and EI (a w''' - w'') = J omega^2 w'.

    The tension drops out of the link's balance: its work on the link, T a w'^2/2, is what the
    beam's end loses.
    """
    link, span = 0.4, L - 0.8
    inertia = mass_factor * M * link**3 / 3

    def residual(omega: float, even: bool) -> float:
        a, b = _wave_numbers(omega, tension_n)
        s = -span / 2
        if even:
            trig = (math.cos(a * s), -a * math.sin(a * s))
            hyper = (math.cosh(b * s), b * math.sinh(b * s))
        else:
            trig = (math.sin(a * s), a * math.cos(a * s))
            hyper = (math.sinh(b * s), b * math.cosh(b * s))
        rows = []
        for (w, slope), square in ((trig, -(a**2)), (hyper, b**2)):
            balance = EI * square * (link * slope - w) - inertia * omega**2 * slope
            rows.append((w - link * slope, balance))
        return (rows[0][0] * rows[1][1] - rows[1][0] * rows[0][1]) / math.cosh(b * s) ** 2

    zones = (Zone(0.0, link, 1e6, mass_factor), Zone(L - link, L, 1e6, mass_factor))
    found = natural_frequencies_hz(replace(PINNED, tension_n=tension_n, zones=zones), 6)
    for i, omega in enumerate(2 * math.pi * found):
        even = i % 2 == 0
        root = _root_near(lambda value, even=even: residual(value, even), omega)  # type: ignore[misc]
        assert omega == pytest.approx(root, rel=1e-5)


# ---------------------------------------------------------------- the population


def _rebuild(seed: int, index: int) -> tuple[Design, tuple[Member, Member]]:
    draws = Draws(seed, index)
    design = list(KINDS.values())[index % len(KINDS)](draws)
    describe(draws, design)
    members, _ = make_members(draws, design, Tolerances())
    return design, members


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return sound_hangers(2026, 480)


def test_convergence_of_the_population() -> None:
    for index in range(40):
        _, members = _rebuild(11, index)
        for member in members:
            usual, fine = (natural_frequencies_hz(member, 8, n) for n in (400, 1200))
            np.testing.assert_allclose(usual, fine, rtol=1.5e-5, err_msg=str(index))


def test_rebuilt_hangers_are_those_measured() -> None:
    """The frequencies in the documents are those of the members, but for the stated errors."""
    for index, case in enumerate(sound_hangers(11, 16)):
        _, members = _rebuild(11, index)
        exact = {p: natural_frequencies_hz(m, 8) for p, m in zip(PLANES, members, strict=True)}
        modes: Any = case.modes["tests"]
        for mode in modes[0]["modes"]:
            error = mode["frequency_hz"] / exact[mode["plane"]][mode["order"] - 1] - 1
            assert 0 < abs(error) < 5 * float(case.truth["scatter_sd"])


def test_seed_decides(cases: list[Case]) -> None:
    assert sound_hangers(2026, 16) == cases[:16]  # whatever the count
    other = sound_hangers(2027, 16)
    assert all(a.modes != b.modes for a, b in zip(cases, other, strict=False))
