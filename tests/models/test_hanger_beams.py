"""The general hanger model where beams have exact solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shm.models import tensioned_beam
from shm.models.hanger import PhysicalHanger, Zone, solve
from tests.helpers.hangers import HANGER_3
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
from tests.helpers.timoshenko import clamped_frequencies_hz

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


@pytest.mark.parametrize("modes", [1, 8, 12])
def test_clamped_bars_are_exact_from_a_beam_to_a_string(modes: int) -> None:
    xi = np.array([0.0, 0.1, 2.0, 6.0, 15.0, 30.0, 60.0, 100.0, 150.0])
    hanger = of_slenderness(xi)
    rigid = np.full((len(xi), 2), np.inf)
    for row in range(len(xi)):
        alone = of_slenderness(xi[row : row + 1])
        expected = exact(alone, rigid[:1], rigid[:1], modes)
        np.testing.assert_allclose(frequencies_hz(alone, modes), expected, rtol=1e-6)
    expected = exact(hanger, rigid, rigid, modes)
    np.testing.assert_allclose(frequencies_hz(hanger, modes), expected, rtol=1e-6)


@settings(max_examples=40, deadline=None)
@given(xi=st.floats(0.0, 150.0), k=st.tuples(springs, springs, springs, springs))
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
    expected = clamped_frequencies_hz(HANGER_3, LENGTH, TENSION, 10)
    np.testing.assert_allclose(frequencies_hz(bar, 10)[0, 0], expected, rtol=2e-6)


def test_a_pinned_bar_that_shears_has_timoshenkos_closed_form() -> None:
    """w ~ sin k x, k = n pi/L, without tension: Omega = omega^2 is the lower root of
    rI m Omega^2 - (EI m k^2 + rI S k^2 + S m) Omega + EI S k^4 = 0 with S = kappa G A."""
    stubby, inertia = 9e7, 1.0
    k = np.arange(1, 9) * np.pi / LENGTH
    a, b, c = (
        inertia * MASS,
        EI * MASS * k**2 + inertia * stubby * k**2 + stubby * MASS,
        EI * stubby * k**4,
    )
    expected = np.sqrt(2 * c / (b + np.sqrt(b**2 - 4 * a * c))) / (2 * np.pi)
    loose = np.zeros((1, 2))
    bar = replace(
        on_springs(of_slenderness(np.zeros(1)), loose, loose),
        shear_compliance_1_n=np.array([1 / stubby]),
        rotary_inertia_kg_m=np.array([inertia]),
    )
    found = frequencies_hz(bar, 8)[0, 0]
    np.testing.assert_allclose(found[:4], expected[:4], rtol=1e-5)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_a_bar_without_shear_is_not_changed_by_one_that_shears_beside_it() -> None:
    both = replace(clamped(2), shear_compliance_1_n=np.array([0.0, 1e-9]))
    found = frequencies_hz(both, 8)
    np.testing.assert_allclose(found[0], frequencies_hz(clamped(), 8)[0], rtol=1e-6)
    assert np.all(found[1] < found[0])


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
    def within(x: float, factor: float) -> float:
        return factor if start < x < end else 1.0

    cuts = [x for x in (start, end) if 0 < x < LENGTH]
    expected = elements_hz(
        lambda x: EI * within(x, stiffness), lambda x: MASS * within(x, mass), cuts, 8
    )
    zone = Zone(*(np.array([value]) for value in (start, end, stiffness, mass)))
    found = frequencies_hz(replace(clamped(), zones=(zone,)), 8)[0, 0]
    np.testing.assert_allclose(found, expected, rtol=5e-5)


def test_overlapping_zones_multiply() -> None:
    def zone(*values: float) -> Zone:
        return Zone(*(np.array([value]) for value in values))

    apart = (zone(2, 4, 2, 3), zone(4, 6, 1.0, 1.5), zone(6, 8, 0.5, 0.5))
    across = (zone(2, 6, 2, 3), zone(4, 8, 0.5, 0.5))
    one, other = (frequencies_hz(replace(clamped(), zones=zones), 8) for zones in (apart, across))
    np.testing.assert_allclose(one, other, rtol=1e-6)


def test_zones_of_no_length_of_no_change_and_in_one_place_change_nothing() -> None:
    one, rng = np.ones(6), np.random.default_rng(0)
    empty = Zone(5 * one, 5 * one, 3 * one, 2 * one)
    behind = Zone(7 * one, 4 * one, 3 * one, 2 * one)
    neutral = Zone(rng.uniform(-1, 6, 6), rng.uniform(6, 13, 6), one, one)
    for zones in ((empty,), (behind,), (neutral,), (neutral, neutral, empty)):
        found = frequencies_hz(replace(clamped(6), zones=zones), 8)
        np.testing.assert_allclose(found, frequencies_hz(clamped(6), 8), rtol=1e-6)


def test_rows_are_solved_together_as_one_by_one() -> None:
    rng, n = np.random.default_rng(2), 12
    factor, one = rng.uniform(0.3, 3, n), np.ones(n)
    zone = Zone(rng.uniform(-1, 6, n), rng.uniform(6, 13, n), factor, one)
    deck, arch = 10 ** rng.uniform(4, 9, (2, n, 2))
    many = replace(on_springs(clamped(n), deck, arch), zones=(zone,))
    together = solve(many, 6, np.array([1.0, 5.0]))
    for row in range(n):
        part = slice(row, row + 1)
        single = replace(
            on_springs(clamped(), deck[part], arch[part]),
            zones=(Zone(*(value[part] for value in vars(zone).values())),),
        )
        alone = solve(single, 6, np.array([1.0, 5.0]))
        np.testing.assert_allclose(alone.frequency_hz[0], together.frequency_hz[row], rtol=1e-8)
        np.testing.assert_allclose(alone.shape[0], together.shape[row], atol=1e-5)


def test_a_bar_that_buckles_gets_a_first_frequency_next_to_nothing() -> None:
    tension = np.array([-0.9, -1.1, -60.0]) * 4 * np.pi**2 * EI / LENGTH**2
    found = frequencies_hz(PhysicalHanger.clamped(HANGER_3, tension), 4)
    assert np.isfinite(np.log(found)).all()
    assert found[0, 0, 0] > 0.5
    assert np.all(found[1:, :, 0] < 0.01)
