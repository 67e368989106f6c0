"""Baseline, scatter of manufacture and effects as one map from parameters to modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.models import THESIS, build
from shm.models.composed import Baseline, ComposedHanger, deviations_of, scattered
from shm.models.effects import Conditions, Variant
from shm.models.hanger import PhysicalHanger, solve
from shm.values import AddedMass, Scatter, Turnbuckle
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import MASS, NOWHERE, TENSION, clamped, frequencies_hz
from tests.helpers.slow import few_of

PLACES = (1.2, 3.6, 6.0, 9.0)
PLAIN = Conditions("t1")
COUPLED = replace(HANGER_3, plate=None, turnbuckles=(Turnbuckle(1.5, 0.6, 150.0, 1e7),))


@pytest.mark.parametrize("hanger", [HANGER_3, COUPLED])
@pytest.mark.parametrize("name", ["beam1", "beam2"])
def test_a_beam_as_baseline_is_the_class_at_the_descriptions_length(name: str, hanger) -> None:
    baseline, model = Baseline(name, hanger), build(name, hanger, THESIS)
    assert "theta_L" not in baseline.names
    rng = np.random.default_rng(0)
    lower, upper = (
        np.array([getattr(p, end) for p in baseline.parameters]) for end in ("lower", "upper")
    )
    theta = rng.uniform(lower, upper, (10, len(lower)))
    whole = np.column_stack([theta[:, :1], np.ones(10), theta[:, 1:]])
    found = frequencies_hz(baseline.physical(theta, 0), 6)
    np.testing.assert_allclose(found, model.frequencies_hz(whole, 6), rtol=5e-5)
    np.testing.assert_array_equal(baseline.ratio(theta, 6), 1)


@pytest.mark.parametrize("name", few_of(["s1", "s2"], 1))
def test_a_solid_baseline_has_the_frequencies_of_its_class_as_it_hangs(name: str) -> None:
    composed = ComposedHanger(HANGER_3, name, [], PLACES)
    model = build(name, HANGER_3, THESIS).as_it_hangs()
    theta = np.array([[0.9, 0, 0, 0, 0], [1.2, 0, 0, 0, 0]])
    found = composed.modes(theta, PLAIN, 4)
    np.testing.assert_allclose(found.frequency_hz, model.frequencies_hz(theta[:, :1], 4), rtol=1e-9)
    if name == "s2":
        np.testing.assert_allclose(composed.physical(theta, PLAIN).deck_end_m, 1.0915)


def test_a_class_that_does_not_describe_the_hanger_is_no_baseline() -> None:
    with pytest.raises(UsageError, match="turnbuckles"):
        Baseline("s1", COUPLED)


@pytest.mark.parametrize(
    ("column", "stiffness", "mass"), [(0, 1.02**2, 1.02), (1, 1, 1.02), (3, 1.02, 1)]
)
def test_scatter_changes_stiffness_and_mass(column: int, stiffness: float, mass: float) -> None:
    deviations = np.zeros((1, 4))
    deviations[0, column] = np.log(1.02)
    made, plain = scattered(clamped(), deviations, HANGER_3), clamped()
    np.testing.assert_allclose(
        made.bending_stiffness_n_m2, plain.bending_stiffness_n_m2 * stiffness
    )
    np.testing.assert_allclose(made.mass_per_length_kg_m, MASS * mass)


def test_deviations_have_normal_priors_of_the_hangers_scatter() -> None:
    hanger = replace(HANGER_3, scatter=Scatter(0.01, 0.02, 0.0, 0.005))
    section, density, length, modulus = deviations_of(hanger)
    np.testing.assert_allclose(density.value(np.array([0.5, 0.8413447])), [0, 0.02], atol=1e-8)
    np.testing.assert_allclose(modulus.share(modulus.value(np.array([0.1, 0.7]))), [0.1, 0.7])
    np.testing.assert_array_equal(length.value(np.array([0.1, 0.9])), 0)
    assert section.upper == 0.01


def test_an_effect_is_applied_and_a_known_mass_too() -> None:
    """A point mass of the catalogue is what a known mass of the test is."""
    with_effect = ComposedHanger(HANGER_3, "beam1", [("point_mass", Variant())], PLACES)
    plain = ComposedHanger(HANGER_3, "beam1", [], PLACES)
    order = [with_effect.names.index(name) for name in ("mass_kg", "x_m")]
    theta = np.zeros((1, len(with_effect.names)))
    theta[0, 0], theta[0, order] = 1.1, (25.0, 3.6)
    one = with_effect.modes(theta, PLAIN, 6)
    known = Conditions("t2", added_mass=AddedMass(25.0, 3.6, 0.0))
    other = plain.modes(theta[:, :5], known, 6)
    np.testing.assert_allclose(one.frequency_hz, other.frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(one.shape, other.shape, atol=1e-9)
    bare = solve(PhysicalHanger.clamped(HANGER_3, np.array([1.1 * TENSION])), 6, NOWHERE)
    assert np.all(one.frequency_hz < bare.frequency_hz)


def test_tests_in_which_the_hanger_is_the_same_are_solved_once() -> None:
    warm = ComposedHanger(HANGER_3, "beam1", [("temperature_tension", Variant())], PLACES)
    theta = np.array([[1.0, 0, 0, 0, 0, -2000.0]])
    cold, same, hot = warm.modes_of_tests(
        theta, [Conditions("a"), Conditions("b"), Conditions("c", temperature_shift_k=20.0)], 5
    )
    assert cold is same
    assert np.all(hot.frequency_hz < cold.frequency_hz)
    again = warm.modes(theta, Conditions("c", temperature_shift_k=20.0), 5)
    np.testing.assert_allclose(again.frequency_hz, hot.frequency_hz, rtol=1e-10)
