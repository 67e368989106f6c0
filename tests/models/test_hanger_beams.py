"""The general hanger model where beams have exact solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shm.models import tensioned_beam
from shm.models.hanger import PhysicalHanger, Zone
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


def test_a_bar_that_buckles_gets_a_first_frequency_next_to_nothing() -> None:
    tension = np.array([-0.9, -1.1, -60.0]) * 4 * np.pi**2 * EI / LENGTH**2
    found = frequencies_hz(PhysicalHanger.clamped(HANGER_3, tension), 4)
    assert np.isfinite(np.log(found)).all()
    assert found[0, 0, 0] > 0.5
    assert np.all(found[1:, :, 0] < 0.01)
