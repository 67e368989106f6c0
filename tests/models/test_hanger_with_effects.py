"""The hanger of a class as made with effects as one map from parameters to modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models import AsMade
from shm.models.effects import Conditions, Variant
from shm.values import AddedMass, FloatArray
from tests.helpers.classes_as_made import as_made
from tests.helpers.classes_as_made import drawn as own_drawn
from tests.helpers.hangers import HANGER_3
from tests.helpers.slow import few_of

PLACES = (1.2, 3.6, 6.0, 9.0)
PLAIN = Conditions("t1")
ROD = replace(HANGER_3, plate=None, fittings_m=(0.4, 0.3), ends="fork")
SETS = 4


def drawn(model: AsMade, *effects: float) -> FloatArray:
    """Draw parameter sets of a class, with the same values of the effects behind."""
    return np.column_stack([own_drawn(model, SETS), np.tile(effects, (SETS, 1))])


@pytest.mark.parametrize("name", few_of(["s1", "s2"], 1))
def test_modes_of_solid_have_the_class_frequencies(name: str) -> None:
    model = as_made(name, HANGER_3)
    bare = model.with_effects([("point_mass", Variant())], PLACES)
    theta = drawn(model, 0.0, 3.0)
    found = bare.modes(theta, PLAIN, 4)
    own = model.frequencies_hz(theta[:, :-2], 4)
    np.testing.assert_allclose(found.frequency_hz, own, rtol=1e-9)
    theta[:, -2] = 30.0
    laden = bare.modes(theta, PLAIN, 4)
    assert np.all(laden.frequency_hz < own)


def test_point_mass_is_what_a_known_mass_is() -> None:
    model = as_made("beam2", ROD)
    with_effect = model.with_effects([("point_mass", Variant())], PLACES)
    assert [each.name for each in with_effect.effect_parameters] == ["mass_kg", "x_m"]
    one = with_effect.modes(drawn(model, 25.0, 3.6), PLAIN, 6)
    known = Conditions("t2", added_mass=AddedMass(25.0, 3.6, 0.0))
    other = model.with_effects([], PLACES).modes(drawn(model), known, 6)
    np.testing.assert_allclose(one.frequency_hz, other.frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(one.shape, other.shape, atol=1e-9)
    own = model.frequencies_at(drawn(model), 6, known)
    np.testing.assert_allclose(one.frequency_hz, own, rtol=2e-4)


def test_like_tests_are_solved_once() -> None:
    model = as_made("beam1", ROD)
    warm = model.with_effects([("temperature_tension", Variant())], PLACES)
    theta = drawn(model, -200.0)
    cold, same, hot = warm.modes_of_tests(
        theta, [Conditions("a"), Conditions("b"), Conditions("c", temperature_shift_k=20.0)], 5
    )
    assert cold is same
    assert np.all(hot.frequency_hz < cold.frequency_hz)
    looser = theta.copy()
    looser[:, 0] -= 200.0 * 20.0 / ROD.nominal_tension_n
    looser[:, -1] = 0.0
    again = warm.physical(looser, PLAIN)
    np.testing.assert_allclose(
        again.tension_n, warm.physical(theta, Conditions(temperature_shift_k=20.0)).tension_n
    )


def test_sag_follows_the_tension_of_a_test() -> None:
    leaning = replace(ROD, inclination_deg=30.0, nominal_tension_n=50e3)
    model = as_made("beam2", leaning)
    bare = model.with_effects([])
    theta = drawn(model)
    theta[:, 0] = np.linspace(0.6, 1.5, SETS)
    theta[:, model.parameter_names.index("sag_shape")] = 0.5
    tighter = theta + np.eye(len(theta[0]))[0] * 5e3 / 50e3
    found = bare.modes(theta, Conditions(tension_shift_n=5e3), 4, shapes=False)
    expected = bare.modes(tighter, PLAIN, 4, shapes=False)
    np.testing.assert_allclose(found.frequency_hz, expected.frequency_hz, rtol=1e-9)
    assert np.all(bare.physical(tighter, PLAIN).sag_parameter[:, 1] > 0.1)
