"""Compare the reduced basis with the general model, closed forms, a rigid link and a string."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from shm.models.classes import tensioned_beam
from shm.models.hanger import PhysicalHanger, PointMass, ReducedBar, Zone, solve
from shm.values import FloatArray, Hanger

SLENDERNESS = (0.5, 3.0, 20.0, 150.0)
ENDS = ((0.0, 0.0), (0.3, 40.0), (0.0, 1e6), (1e6, 1e6))
MODES = 8
ZONES = [(0.0, 0.03), (0.95, 1.0), (0.3, 0.36)]
UNIT = Hanger(1, 1.0, 1.0, 1e4, 1.0, 1.0, 1.0)
"""Of unit length, bending stiffness and mass, and 10,000 times as stiff along its axis."""
TO_HZ = 1 / (2 * np.pi)


def bars(tension: FloatArray, springs: FloatArray | None = None) -> PhysicalHanger:
    """Return unit bars at tensions (n,) on springs (n, ends, planes), hinged if there are none."""
    found = PhysicalHanger.clamped(UNIT, tension)
    compliance = np.inf if springs is None else 1 / springs
    found.rotational_compliance_rad_n_m[:, :, [0, 1], [0, 1]] = compliance
    return found


def drawn_bars(n: int, seed: int, shears: bool, laden: bool, alike: bool) -> PhysicalHanger:
    """Return hangers of three zones: fittings and a turnbuckle, uncertain in all."""
    rng = np.random.default_rng(seed)
    tension = 60 * np.exp(rng.normal(0, 0.5, n))
    factors = np.exp(rng.normal([[1.5], [1.5], [2.0]], 0.6, (n, 3, 2)))
    # Fittings are equally heavy: masses are combinations of three matrices, or with one of two.
    heavier = np.sqrt(factors[:, 0, 0]) * np.exp(rng.normal(0, 0.2, n))
    masses = (heavier, heavier, heavier if alike else np.sqrt(factors[:, 2, 0]))
    one = np.ones(n)
    return replace(
        bars(tension, 10 ** rng.uniform(-1, 3, (n, 2, 2))),
        tension_gradient_n=rng.uniform(0, 0.3, n) * tension,
        sag_parameter=np.stack([0 * one, rng.uniform(0, 5, n)], axis=1),
        zones=tuple(
            Zone(start * one, end * one, factors[:, k], masses[k])
            for k, (start, end) in enumerate(ZONES)
        ),
        shear_compliance_1_n=1 / rng.uniform(3e3, 6e3, n) if shears else 0 * one,
        rotary_inertia_kg_m=rng.uniform(0.5e-4, 1e-4, n) if shears else 0 * one,
        masses=(PointMass(0.22 * one, rng.uniform(0, 0.3, n)),) if laden else (),
    )


def by_all_functions(bar: ReducedBar, physical: PhysicalHanger) -> FloatArray:
    """Return frequencies (n, 2, MODES) by all functions that the basis is made of."""
    factors = bar._factors(physical)
    found = np.empty((*factors.unit_hz.shape, MODES))
    for plane, row in np.ndindex(*factors.stiffness.shape[:2]):
        stiffness = np.tensordot(factors.stiffness[plane, row], bar._full.stiffness, 1)
        mass = np.tensordot(factors.mass[plane, row], bar._full.mass, 1)
        # Of the inverse the lowest modes are the largest values: stiff springs round nothing away.
        found[row, plane] = eigh(mass, stiffness, eigvals_only=True)[::-1][:MODES] ** -0.5
    return np.asarray(found * factors.unit_hz[..., None])


@pytest.mark.parametrize(
    ("shears", "laden", "alike"),
    [
        (False, False, False),
        (False, True, False),
        (True, False, False),
        (True, True, False),
        (False, False, True),
    ],
)
def test_hangers_that_the_basis_was_not_made_from(shears: bool, laden: bool, alike: bool) -> None:
    """Find diagonal masses in the basis where all zones are `alike` in mass."""
    usual, others = (drawn_bars(n, k, shears, laden, alike) for n, k in ((60, 1), (40, 2)))
    bar = ReducedBar(usual, MODES)
    found = bar.frequencies_hz(others)
    np.testing.assert_allclose(found, by_all_functions(bar, others), rtol=1e-4)
    if not shears:
        expected = solve(others, MODES, np.empty(0), shapes=False).frequency_hz
        np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert bar._matrices.diagonal_mass is alike


def test_gradient_is_felt_to_second_order() -> None:
    """Turn a bar with equal ends round: its frequencies stay."""
    equal = np.linspace(0.01, 0.1, 6)[:, None, None] * np.ones((6, 2, 2))
    plain = bars(400 * np.linspace(1.0, 1.2, 6), equal)
    up, down = (replace(plain, tension_gradient_n=np.full(6, each)) for each in (60.0, -60.0))
    bar = ReducedBar(plain, 4)
    level, rising, falling = (bar.frequencies_hz(each)[0] for each in (plain, up, down))
    np.testing.assert_allclose(rising, falling, rtol=1e-8)
    assert np.all(rising[:, 0] < level[:, 0])
    np.testing.assert_allclose(rising, level, rtol=(60 / 400) ** 2)
    exact = solve(up, 4, np.empty(0), shapes=False).frequency_hz[0]
    np.testing.assert_allclose(rising, exact, rtol=1e-4)


def on_springs(xi: float, ends: tuple[float, float]) -> PhysicalHanger:
    """Return one bar of slenderness xi, on springs alike in both planes."""
    with np.errstate(divide="ignore"):
        return bars(np.array([xi**2]), np.repeat([[ends]], 2, axis=1).swapaxes(1, 2))


@pytest.mark.parametrize("xi", SLENDERNESS)
@pytest.mark.parametrize("ends", ENDS)
def test_a_bar_on_springs_has_the_frequencies_of_its_closed_form(
    xi: float, ends: tuple[float, float]
) -> None:
    physical = on_springs(xi, ends)
    expected = tensioned_beam.frequencies_hz(*map(np.array, (1.0, xi**2, 1.0, 1.0, *ends)), MODES)
    found = solve(physical, MODES, np.empty(0), shapes=False).frequency_hz[0, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    of_basis = by_all_functions(ReducedBar(physical, MODES), physical)[0, 0]
    np.testing.assert_allclose(of_basis, expected, rtol=1e-6)


@pytest.mark.parametrize("xi", SLENDERNESS)
@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("gyration", [0.002, 0.01])
def test_a_bar_that_shears_has_the_frequencies_of_its_closed_form(
    xi: float, ends: tuple[float, float], gyration: float
) -> None:
    """Take a third of E A as shear stiffness, about that of steel."""
    compliance, inertia = np.array([3 * gyration**2]), np.array([gyration**2])
    physical = replace(
        on_springs(xi, ends), shear_compliance_1_n=compliance, rotary_inertia_kg_m=inertia
    )
    bar = map(np.array, (1.0, xi**2, 1.0, 1.0, *ends))
    section = map(np.array, (3 * gyration**2, gyration))
    expected = tensioned_beam.frequencies_hz(*bar, MODES, *section)
    found = by_all_functions(ReducedBar(physical, MODES), physical)[0, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("spring", [1e6, 1e12])
def test_ends_that_clamp_have_the_closed_form(spring: float) -> None:
    """Clamp with stiffer ends than the basis takes, too."""
    tension = 60 * np.linspace(1.0, 1.2, 60)
    usual = bars(tension, 10 ** np.linspace(-1, 7, 240).reshape(60, 2, 2))
    found = ReducedBar(usual, MODES).frequencies_hz(bars(tension[:5], np.full((5, 2, 2), spring)))
    ones = np.ones(5)
    bar = (ones, tension[:5], ones, ones, ones * spring, ones * spring)
    expected = tensioned_beam.frequencies_hz(*bar, MODES)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-5)
    np.testing.assert_allclose(found[:, 1], expected, rtol=1e-5)


def shifted(here: PhysicalHanger, step: float) -> list[PhysicalHanger]:
    """Return bars with one quantity after the other larger by a small part."""
    names = ("tension_n", "tension_gradient_n", "rotational_compliance_rad_n_m", "sag_parameter",
             "shear_compliance_1_n", "rotary_inertia_kg_m")  # fmt: skip
    found = [replace(here, **{name: getattr(here, name) * (1 + step)}) for name in names]
    for name in ("stiffness_factor", "mass_factor"):
        zones = (replace(z, **{name: getattr(z, name) * (1 + step)}) for z in here.zones)
        found.append(replace(here, zones=tuple(zones)))
    (mass,) = here.masses
    return [*found, replace(here, masses=(replace(mass, mass_kg=mass.mass_kg * (1 + step)),))]


def test_frequencies_about_a_hanger_are_those_of_small_differences() -> None:
    bar = ReducedBar(drawn_bars(60, 1, True, True, False), MODES)
    here = drawn_bars(10, 3, True, True, False)
    near = shifted(here, 1e-4)
    modes, moved = bar.modes_about(here, near, np.empty(0))
    found = modes.frequency
    np.testing.assert_allclose(found, bar.frequencies_hz(here), rtol=1e-9)  # rounding
    for of_near, each in zip(moved, near, strict=True):
        change, difference = of_near.frequency - found, bar.frequencies_hz(each) - found
        assert np.abs(difference).max() > 1e-7 * TO_HZ
        np.testing.assert_allclose(change, difference, atol=1e-7 * found.max())
        assert np.corrcoef(change.ravel(), difference.ravel())[0, 1] > 0.9999


@pytest.mark.parametrize("tension", [4.0, 400.0])
def test_a_mass_in_the_middle_of_a_hinged_bar_has_its_closed_form(tension: float) -> None:
    """Solve half of the bar: the slope vanishes in its middle, and shear moves the mass."""
    mass = 0.2

    def fault(omega: float) -> float:
        q2 = np.sqrt(tension**2 / 4 + omega**2) - tension / 2
        q, p = np.sqrt(q2), np.sqrt(q2 + tension)
        # w = sin qx/(q cos qh) - sinh px/(p cosh ph), times cos qh.
        w = np.sin(q / 2) / q - np.cos(q / 2) * np.tanh(p / 2) / p
        third = -(q**2 + p**2) * np.cos(q / 2)
        return float(2 * third + mass * omega**2 * w)

    grid = np.linspace(1e-2, 1.2 * 5 * np.pi * np.hypot(np.sqrt(tension), 5 * np.pi), 3000)
    odd = np.array(roots_of(np.array([fault(omega) for omega in grid]), grid, fault)[:3])
    masses = (PointMass(np.full(6, 0.5), mass * np.linspace(1.0, 1.5, 6)),)
    hinged = replace(bars(tension * np.linspace(1.0, 1.2, 6)), masses=masses)
    found = ReducedBar(hinged, 6).frequencies_hz(hinged)[0, 0] / TO_HZ
    np.testing.assert_allclose(found[::2], odd, rtol=1e-5)
    even = np.arange(2, 7, 2) * np.pi
    np.testing.assert_allclose(found[1::2], even * np.sqrt(tension + even**2), rtol=1e-5)


def roots_of(values: FloatArray, grid: FloatArray, fault: Callable[[float], float]) -> list[float]:
    """Return the roots of a function between the points of a grid where its sign changes."""
    signs = np.sign(values)
    at = np.flatnonzero(signs[1:] != signs[:-1])
    return [brentq(fault, grid[k], grid[k + 1], xtol=1e-10) for k in at]


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
    values = np.array([determinant(omega) for omega in grid])
    return np.array(roots_of(values, grid, determinant)[:modes])


@pytest.mark.parametrize("tension", [1.0, 60.0, 2500.0])
def test_a_nearly_rigid_zone_at_a_hinge_is_a_rigid_link(tension: float) -> None:
    link, heavier, near = 0.08, 3.0, np.linspace(1.0, 1.05, 6)
    expected = link_and_bar(tension, link, heavier, MODES)

    def solved(stiffer: float) -> FloatArray:
        one = np.ones_like(near)
        zone = Zone(0 * one, link * one, stiffer * one, heavier * one)
        bar = replace(bars(tension * near), zones=(zone,))
        return np.asarray(by_all_functions(ReducedBar(bar, MODES), bar)[0, 0] / TO_HZ)

    np.testing.assert_allclose(solved(1e6), expected, rtol=1e-5)
    assert np.abs(solved(1.0) / expected - 1).max() > 0.01


@pytest.mark.parametrize("gradient", [0.0, 150.0, -300.0])
def test_a_hanging_string_has_the_frequencies_of_its_equation(gradient: float) -> None:
    """(T w')' = - omega2 w of T = T0 + g (x - 1/2), by finite differences of the second order."""
    tension, count = 1e5, 600
    steep = 400 * gradient  # bending is felt by 3e-3
    bar = replace(bars(np.array([tension])), tension_gradient_n=np.array([steep]))
    found = solve(bar, 3, np.empty(0), shapes=False).frequency_hz[0, 0] / TO_HZ
    middles = (np.arange(count) + 0.5) / count
    pull = (tension + steep * (middles - 0.5)) * count**2
    difference = np.diag(pull[1:] + pull[:-1]) - np.diag(pull[1:-1], 1) - np.diag(pull[1:-1], -1)
    expected = np.sqrt(eigh(difference, eigvals_only=True, subset_by_index=[0, 2]))
    np.testing.assert_allclose(found, expected, rtol=2e-3)
