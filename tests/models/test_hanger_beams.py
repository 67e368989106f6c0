"""The general hanger model where beams have exact solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from shm.models.classes import tensioned_beam
from shm.models.hanger import PhysicalHanger, Zone, solve
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    MASS,
    TENSION,
    clamped,
    frequencies_hz,
    of_slenderness,
    on_springs,
)
from tests.helpers.timoshenko import legendre_hz
from tests.worlds.eight_kinds import Member, natural_frequencies_hz
from tests.worlds.eight_kinds import Zone as ElementZone

CLAMPED = (np.inf, np.inf)
springs = st.one_of(st.just(0.0), st.just(np.inf), st.floats(1e-3, 1e15))


def exact(hanger: PhysicalHanger, deck, arch, modes: int) -> np.ndarray:
    return tensioned_beam.frequencies_hz(
        hanger.length_m[:, None],
        hanger.tension_n[:, None],
        hanger.bending_stiffness_n_m2,
        hanger.mass_per_length_kg_m[:, None],
        deck,
        arch,
        modes,
    )


@settings(max_examples=40, deadline=None)
@given(xi=st.floats(0.0, 150.0), k=st.tuples(springs, springs, springs, springs))
@example(xi=0.0, k=(np.inf,) * 4)
@example(xi=150.0, k=(np.inf,) * 4)
def test_springs_from_none_to_rigid_are_exact(xi: float, k: tuple[float, ...]) -> None:
    bar = of_slenderness(np.array([xi]))
    deck, arch = np.array([k[:2]]), np.array([k[2:]])
    found = frequencies_hz(on_springs(bar, deck, arch), 10)
    np.testing.assert_allclose(found, exact(bar, deck, arch, 10), rtol=1e-6)


def test_shear_and_rotary_inertia_are_timoshenkos() -> None:
    """Clamped under tension: against Legendre polynomials for deflection and rotation."""
    modulus, nu = HANGER_3.elastic_modulus_pa, HANGER_3.poissons_ratio
    coefficient = 6 * (1 + nu) / (7 + 6 * nu)
    shear = coefficient * modulus / (2 * (1 + nu)) * HANGER_3.area_m2
    bar = replace(
        clamped(),
        shear_compliance_1_n=np.array([1 / shear]),
        rotary_inertia_kg_m=np.array([MASS / HANGER_3.area_m2 * HANGER_3.second_moment_m4]),
    )
    expected = legendre_hz(HANGER_3, LENGTH, TENSION, 10)
    np.testing.assert_allclose(frequencies_hz(bar, 10)[0, 0], expected, rtol=2e-6)


ZONES = [
    (0.0, 0.006, 100.0, 1.0),
    (0.0, 0.8, 5.0, 1.0),
    (2.9, 4.1, 0.25, 0.5),
    (5.5, 6.5, 0.5, 0.7),
    (11.0, 14.0, 0.5, 0.7),
    (-1.0, 13.0, 0.8, 0.9),
]


@pytest.mark.parametrize(("start", "end", "stiffness", "mass"), ZONES)
def test_a_zone_agrees_with_fine_elements(start, end, stiffness, mass) -> None:
    inside = ElementZone(max(start, 0.0), min(end, LENGTH), stiffness, mass)
    member = Member(LENGTH, TENSION, EI, MASS, zones=(inside,), rotation_n_m_rad=CLAMPED)
    expected = natural_frequencies_hz(member, 8, 24)
    zone = Zone(*(np.array([value]) for value in (start, end, stiffness, mass)))
    found = frequencies_hz(replace(clamped(), zones=(zone,)), 8)[0, 0]
    np.testing.assert_allclose(found, expected, rtol=5e-5)


def test_a_bar_that_buckles_gets_a_first_frequency_next_to_nothing() -> None:
    tension = np.array([-0.9, -1.1, -60.0]) * 4 * np.pi**2 * EI / LENGTH**2
    found = frequencies_hz(PhysicalHanger.clamped(HANGER_3, tension), 4)
    assert np.isfinite(np.log(found)).all()
    assert found[0, 0, 0] > 0.5
    assert np.all(found[1:, :, 0] < 0.01)


START, END = 2.0, 5.0
EULER_N = 4 * np.pi**2 * EI / LENGTH**2  # of a clamped bar


def zone(n: int, start: float, end: float, stiffness: float, mass: float) -> tuple[Zone, ...]:
    return (Zone(*(np.full(n, each) for each in (start, end, stiffness, mass))),)


@pytest.mark.parametrize(("stiffness", "mass"), [(0.2, 1.0), (1.0, 0.1), (0.3, 3.0)])
def test_solve_compressed_zone(stiffness: float, mass: float) -> None:
    force_n = 0.3 * EULER_N
    weak = (ElementZone(START, END, stiffness, mass),)
    held = Member(LENGTH, -force_n, EI, MASS, zones=weak, rotation_n_m_rad=(np.inf, np.inf))
    expected = natural_frequencies_hz(held, 5, 24)
    bar = PhysicalHanger.clamped(HANGER_3, np.array([-force_n]))
    bar = replace(bar, zones=zone(1, START, END, stiffness, mass))
    np.testing.assert_allclose(frequencies_hz(bar, 5)[0, 0], expected, rtol=3e-4)


def weak_and_light(n: int) -> dict[str, object]:
    return {"zones": zone(n, START, END, 0.02, 0.3)}


def heavy_millimetre(n: int) -> dict[str, object]:
    """Return a zone so short that functions are nearly dependent: rounding decides."""
    return {"zones": zone(n, 0.7 * LENGTH, 0.7001 * LENGTH, 1.0, 1.5)}


def hinged_and_free_end(n: int) -> dict[str, object]:
    sideways, turning = np.zeros((n, 2, 2)), np.zeros((n, 2, 2, 2))
    sideways[:, 0] = np.inf
    turning[..., [0, 1], [0, 1]] = np.inf
    return {"translational_compliance_m_n": sideways, "rotational_compliance_rad_n_m": turning}


def deep_sag(n: int) -> dict[str, object]:
    return {"sag_parameter": np.full((n, 2), 20.0)}


@pytest.mark.parametrize("shapes", [False, True])
@pytest.mark.parametrize("make", [weak_and_light, heavy_millimetre, hinged_and_free_end, deep_sag])
def test_solve_beyond_buckling(make, shapes: bool) -> None:
    tension = -np.geomspace(0.01, 600.0, 24) * EULER_N
    bar = PhysicalHanger.clamped(HANGER_3, tension)
    found = solve(replace(bar, **make(len(tension))), 4, np.array([1.0, 5.0]), shapes)
    assert np.isfinite(np.log(found.frequency_hz)).all()
    assert np.all(found.frequency_hz[-1] < 0.01)  # a buckled bar does not swing
