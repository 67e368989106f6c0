"""The posterior predictive p-value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.gap.residuals import predictions, predictive_p_value
from shm.gap.search import fit_alone
from tests.gap import linear_toy as toy
from tests.helpers.gap_campaigns import campaign, problem_of


def _p_values(gap: np.ndarray, count: int) -> np.ndarray:
    none = toy.fit(np.zeros(toy.design().size), toy.tension())
    found = []
    for seed in range(count):
        value = toy.noise(np.random.default_rng(seed)) + gap
        found.append(predictive_p_value(toy.observations(value), none.predicted[None], none.noise))
    return np.array(found)


def test_data_of_the_hypothesis_are_seldom_found_odd() -> None:
    found = _p_values(np.zeros(toy.design().size), 200)
    assert np.mean(found < 0.05) <= 0.09
    assert np.median(found) > 0.3


def test_a_gap_that_repeats_in_every_test_is_found_though_each_test_hides_it() -> None:
    assert np.median(_p_values(toy.stiffening(3e-4), 20)) < 0.01


def test_shapes_that_are_off_are_found() -> None:
    gap = np.zeros(toy.design().size)
    gap[toy.design().frequencies :: 2] = 1.5 * toy.SHAPE_SD
    assert np.median(_p_values(gap, 20)) < 0.01


def test_along_a_bent_ridge_of_end_springs_sound_data_are_not_odd_and_a_gap_is() -> None:
    """By the slopes at the best point draws had p = 0.008 here, 1e-190 in a blind case."""
    problem = problem_of(campaign(tests=1, modes=3, sd=1e-4), "beam2")
    fit = fit_alone(problem, np.random.default_rng(1))
    seen, gap = problem.observations.value, np.zeros(problem.design.size)
    gap[0] = 0.01
    predicted = predictions(problem, fit)
    for value, odd in ((seen, False), (seen + gap, True)):
        measured = replace(problem.observations, value=value)
        assert (predictive_p_value(measured, predicted, fit.noise) < 0.1) is odd
