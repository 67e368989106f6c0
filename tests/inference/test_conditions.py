"""Each test is predicted under its own conditions, those alike to the class in one evaluation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.inference import UpdateOptions, update
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.models import THESIS, Model, build
from shm.models.classes.base import Conditions
from shm.values import NAN, AddedMass, ModalTest, Mode
from tests.helpers.given_modes import with_modes
from tests.helpers.hangers import HANGER_3

WARMTH = "beam1+temperature_tension@everywhere:reference_c=10"
SD = 1e-3


def measured(
    model: Model, theta: np.ndarray, tests: list[ModalTest], modes: int = 6, seed: int = 1
) -> list[ModalTest]:
    """`tests` with the frequencies that the model gives them, each off by 0.1 %."""
    rng, found = np.random.default_rng(seed), []
    for test in tests:
        exact = model.frequencies_at(theta, modes, model.conditions(test))[0]
        noisy = with_modes(exact, SD, SD * rng.standard_normal(exact.shape))
        found.append(replace(test, modes=noisy.modes))
    return found


def parameters(model: Model, **values: float) -> np.ndarray:
    known = {"theta_F": 1.0, **values}
    return np.array([[known.get(name, 0.0) for name in model.parameter_names]])


def a_test(name: str, temperature_c: float = NAN, mass: AddedMass | None = None) -> ModalTest:
    return ModalTest(name, (), 3, temperature_c=temperature_c, added_mass=mass)


def test_each_test_is_predicted_under_its_own_conditions() -> None:
    model = build(WARMTH, HANGER_3, THESIS)
    theta = parameters(model, tension_per_kelvin_n_k=-3000.0)
    tests = measured(model, theta, [a_test("a", 10.0), a_test("b", 25.0), a_test("c", 10.0)])
    tests[1] = replace(tests[1], modes=tests[1].modes[3:8])
    predicted = ThesisLikelihood(tests).predict(model, theta)
    assert predicted.shape == (1, 12 + 5 + 12)
    np.testing.assert_array_equal(predicted[:, :12], predicted[:, 17:])
    warm = model.frequencies_at(theta, 6, Conditions(temperature_shift_k=15.0))
    np.testing.assert_array_equal(predicted[0, 12:17], warm.ravel()[3:8])
    exact = np.array([mode.frequency_hz for test in tests for mode in test.modes])
    np.testing.assert_allclose(predicted[0], exact, rtol=5 * SD)


def test_tests_alike_to_the_class_are_one_evaluation(monkeypatch: pytest.MonkeyPatch) -> None:
    model, asked = build("beam1", HANGER_3, THESIS), []
    evaluate = model.frequencies_hz
    theta = np.array([[1.0, 1.0]])
    tests = measured(model, theta, [a_test("a", 10.0), a_test("b", 25.0)])

    def count(theta, modes):  # type: ignore[no-untyped-def]
        asked.append(modes)
        return evaluate(theta, modes)

    monkeypatch.setattr(model, "frequencies_hz", count)
    predicted = ThesisLikelihood(tests).predict(model, theta)
    assert asked == [6]
    np.testing.assert_array_equal(predicted[:, :12], predicted[:, 12:])


def test_an_adopted_class_recovers_the_planted_tension_and_covers_it() -> None:
    """A strand with 30 % less bending stiffness: the clamped rod puts its tension 5 % off."""
    model = build("beam1+bending_stiffness@everywhere", HANGER_3, THESIS)
    theta = parameters(model, stiffness_change=-0.3)
    (test,) = measured(model, theta, [a_test("a")])
    options = UpdateOptions(samples=200)
    found = update([test], model, options)
    low, high = np.quantile(found.tension_n, [0.025, 0.975])
    assert low < HANGER_3.nominal_tension_n < high
    assert found.parameter("stiffness_change").mean() == pytest.approx(-0.3, abs=0.08)
    assert max(abs(p.mean_hz / p.measured_hz - 1) for p in found.predicted) < 4 * SD
    assert found.r_hat < 1.1


def test_no_tension_is_inferred_from_an_irregular_mode() -> None:
    irregular, regular = Mode("transverse", 1, 7.0, irregular=True), Mode("transverse", 2, 13.85)
    tests = [ModalTest("t1", (irregular, regular), 3), ModalTest("t2", (regular, regular), 3)]
    likelihood = ThesisLikelihood(tests)
    assert likelihood.modes == [regular] * 3
    model = build("beam1", HANGER_3, THESIS)
    assert likelihood.predict(model, parameters(model, theta_L=1.0)).shape == (1, 3)
