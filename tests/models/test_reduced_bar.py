"""Compare the reduced basis with its full elements, Irvine's cable and a mass on a bar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from shm.models import tensioned_beam
from shm.models.bar_elements import bar_elements
from shm.models.reduced_bar import BarTerms, ReducedBar
from shm.values import FloatArray

MODES = 8
ZONES = [(0.0, 0.03), (0.95, 1.0), (0.3, 0.36)]
PLACES = (0.22,)


def drawn_terms(
    n: int, seed: int, shears: bool = True, laden: bool = True, alike: bool = False
) -> BarTerms:
    """Return hangers of three zones: fittings and a turnbuckle, uncertain in all."""
    rng = np.random.default_rng(seed)
    tension = 60 * np.exp(rng.normal(0, 0.5, n))
    factors = np.exp(rng.normal([[1.5], [1.5], [2.0]], 0.6, (n, 3, 2)))
    # Fittings are equally heavy: masses are combinations of three matrices, or with one of two.
    heavier = np.sqrt(factors[:, :1, 0]) * np.exp(rng.normal(0, 0.2, (n, 1)))
    coupler = heavier if alike else np.sqrt(factors[:, 2:, 0])
    return BarTerms(
        tension=tension,
        gradient=rng.uniform(0, 0.3, n) * tension,
        springs=10 ** rng.uniform(-1, 3, (n, 2, 2)),
        stiffness=factors,
        mass=np.hstack([heavier, heavier, coupler]),
        sag=rng.uniform(0, 5, n) * tension,
        shear=rng.uniform(3e3, 6e3, n) if shears else np.full(n, np.nan),
        turning=rng.uniform(0.5e-4, 1e-4, n),
        point_masses=rng.uniform(0, 0.3, (n, 1)) if laden else np.empty((n, 0)),
    )


def uniform(
    n: int, tension: float, sag: float = 0.0, point_mass: float = 0.0, gradient: float = 0.0
) -> BarTerms:
    """Return hangers without zones, the first on hinges, others on springs that hardly hold."""
    laden = point_mass * np.linspace(1.0, 1.5, n)[:, None]
    return BarTerms(
        tension=tension * np.linspace(1.0, 1.2, n),
        gradient=gradient * np.ones(n),
        springs=np.linspace(0, 0.1, n)[:, None, None] * np.ones((n, 2, 2)),
        stiffness=np.empty((n, 0, 2)),
        mass=np.empty((n, 0)),
        sag=sag * np.linspace(1.0, 3.0, n),
        shear=np.full(n, np.nan),
        turning=np.zeros(n),
        point_masses=laden if point_mass else laden[:, :0],
    )


def full_frequencies(terms: BarTerms, row: int, plane: int, decay: float) -> FloatArray:
    """Return omega (MODES,) of one hanger by all its elements."""
    shears = bool(np.isfinite(terms.shear).all())
    elements = bar_elements(ZONES, decay, MODES, shears, PLACES)
    stiffness = elements.bending[0] + terms.tension[row] * elements.tension
    stiffness = stiffness + terms.gradient[row] * elements.gradient
    mass = elements.mass[0].copy()
    if shears:
        stiffness = stiffness + terms.shear[row] * elements.shear
        mass = mass + terms.turning[row] * elements.turning[0]
    for zone in range(3):
        stiffness = stiffness + terms.stiffness[row, zone, plane] * elements.bending[zone + 1]
        mass = mass + terms.mass[row, zone] * elements.mass[zone + 1]
        if shears:
            heavier = terms.turning[row] * terms.mass[row, zone]
            mass = mass + heavier * elements.turning[zone + 1]
    for end in (0, 1):
        rotation = elements.end_rotation[end]
        stiffness = stiffness + terms.springs[row, end, plane] * np.outer(rotation, rotation)
    if plane == 1:
        stiffness = stiffness + terms.sag[row] * np.outer(elements.area, elements.area)
    if terms.point_masses.size:
        at = elements.deflection(np.array(PLACES))[0]
        mass = mass + terms.point_masses[row, 0] * np.outer(at, at)
    # Of the inverse the lowest modes are the largest values: stiff springs round nothing away.
    return np.asarray(eigh(mass, stiffness, eigvals_only=True)[::-1][:MODES] ** -0.5)


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
def test_hangers_that_the_basis_was_not_made_from_have_their_frequencies(
    shears: bool, laden: bool, alike: bool
) -> None:
    """Find diagonal masses in the basis where all zones are `alike` in mass."""
    usual, others = (drawn_terms(n, k, shears, laden, alike) for n, k in ((60, 1), (40, 2)))
    bar = ReducedBar(ZONES, usual, MODES, PLACES if laden else ())
    found = bar.frequencies(others)
    decay = float(np.sqrt(np.median(usual.tension)))
    for row in range(40):
        for plane in (0, 1):
            expected = full_frequencies(others, row, plane, decay)
            np.testing.assert_allclose(found[row, plane], expected, rtol=1e-4)
    assert bar._reduced.diagonal_mass is alike
    mass = bar._reduced.assembled(others, 0)[1]
    across = mass - np.einsum("nii->ni", mass)[:, :, None] * np.eye(mass.shape[1])
    assert (np.abs(across).max() < 1e-6 * np.abs(mass).max()) is np.bool_(alike)


def test_a_gradient_of_the_tension_is_felt_to_second_order() -> None:
    """Turn a bar with equal ends round: its frequencies stay."""
    plain, up, down = (uniform(6, 400.0, gradient=each) for each in (0.0, 60.0, -60.0))
    bar = ReducedBar([], plain, 4)
    level, rising, falling = (bar.frequencies(each)[0] for each in (plain, up, down))
    np.testing.assert_allclose(rising, falling, rtol=1e-8)
    assert np.all(rising[:, 0] < level[:, 0])
    np.testing.assert_allclose(rising, level, rtol=(60 / 400) ** 2)
    np.testing.assert_allclose(bar.full_frequencies(up)[0], rising, rtol=1e-4)


@pytest.mark.parametrize("spring", [1e6, 1e12])
def test_ends_that_clamp_have_the_closed_form(spring: float) -> None:
    """Clamp with stiffer ends than the basis takes, too."""
    usual = replace(uniform(60, 60.0), springs=10 ** np.linspace(-1, 7, 240).reshape(60, 2, 2))
    terms = replace(usual.take(slice(0, 5)), springs=np.full((5, 2, 2), spring))
    found = ReducedBar([], usual, MODES).frequencies(terms)
    ones = np.ones(5)
    bar = (ones, terms.tension, ones, ones, ones * spring, ones * spring)
    expected = 2 * np.pi * tensioned_beam.frequencies_hz(*bar, MODES)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-5)
    np.testing.assert_allclose(found[:, 1], expected, rtol=1e-5)


def test_frequencies_about_a_hanger_are_those_of_small_differences() -> None:
    bar, here = ReducedBar(ZONES, drawn_terms(60, 1), MODES, PLACES), drawn_terms(10, 3)
    step = 1e-4
    shifted = [
        replace(here, tension=here.tension * (1 + step)),
        replace(here, gradient=here.gradient * (1 + step)),
        replace(here, springs=here.springs * (1 + step)),
        replace(here, stiffness=here.stiffness * (1 + step)),
        replace(here, mass=here.mass * (1 + step)),
        replace(here, sag=here.sag * (1 + step)),
        replace(here, shear=here.shear * (1 + step)),
        replace(here, turning=here.turning * (1 + step)),
        replace(here, point_masses=here.point_masses * (1 + step)),
    ]
    modes, moved = bar.modes_about(here, shifted, np.empty(0))
    found, near = modes.frequency, np.array([each.frequency for each in moved])
    np.testing.assert_allclose(found, bar.frequencies(here), rtol=1e-9)  # rounding
    for moved, each in zip(near, shifted, strict=True):
        difference = bar.frequencies(each) - found
        assert np.abs(difference).max() > 1e-7
        np.testing.assert_allclose(moved - found, difference, atol=1e-7 * found.max())
        assert np.corrcoef((moved - found).ravel(), difference.ravel())[0, 1] > 0.9999


@pytest.mark.parametrize("tension", [4.0, 400.0])
def test_a_mass_in_the_middle_of_a_hinged_bar_has_its_closed_form(tension: float) -> None:
    """Solve half of the bar: the slope vanishes in its middle, and shear moves the mass."""
    mass = 0.2
    terms = uniform(6, tension, point_mass=mass)

    def fault(omega: float) -> float:
        q2 = np.sqrt(tension**2 / 4 + omega**2) - tension / 2
        q, p = np.sqrt(q2), np.sqrt(q2 + tension)
        # w = sin qx/(q cos qh) - sinh px/(p cosh ph), times cos qh.
        w = np.sin(q / 2) / q - np.cos(q / 2) * np.tanh(p / 2) / p
        third = -(q**2 + p**2) * np.cos(q / 2)
        return float(2 * third + mass * omega**2 * w)

    grid = np.linspace(1e-2, 1.2 * 5 * np.pi * np.hypot(np.sqrt(tension), 5 * np.pi), 3000)
    signs = np.sign([fault(omega) for omega in grid])
    at = np.flatnonzero(signs[1:] != signs[:-1])[:3]
    odd = np.array([brentq(fault, grid[k], grid[k + 1]) for k in at])
    found = ReducedBar([], terms, 6, (0.5,)).frequencies(terms)[0, 0]
    np.testing.assert_allclose(found[::2], odd, rtol=1e-5)
    even = np.arange(2, 7, 2) * np.pi
    np.testing.assert_allclose(found[1::2], even * np.sqrt(tension + even**2), rtol=1e-5)
