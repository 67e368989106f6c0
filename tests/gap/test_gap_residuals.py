"""Residuals and trends against closed forms of a linear toy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.causes.residuals import (
    HeldOut,
    predictions,
    predictive_p_values,
    residuals,
    trends,
)
from shm.gap.causes.search import fit_alone
from shm.gap.hypotheses.contract import Hypothesis, Observations
from shm.models.effects import Conditions
from shm.values import AddedMass
from tests.gap import linear_toy as plain
from tests.helpers.gap_campaigns import campaign as own_campaign
from tests.helpers.gap_campaigns import problem_of
from tests.helpers.toy_gap import SD, ToyProblem, campaign, design_of, tension

MODES = [(plane, order) for plane in (0, 1) for order in range(1, 7)]


def toy(gap, conditions=None, modes=MODES):
    """Measured: the toy's prediction, plus `gap` (frequencies,)."""
    design = design_of(conditions or campaign(), modes)
    observations = Observations(design, 0.05 + gap(design), np.full(design.size, SD))
    return ToyProblem(observations, {Hypothesis(): tension})


def fourth(design):
    return 0.01 * (design.frequency_order == 4)


def warmer(design):
    shift_k = np.array([each.temperature_shift_k for each in design.conditions])
    return 2e-4 * shift_k[design.frequency_test]


def nothing(problem):
    """Of which nothing is held out."""
    return HeldOut(*np.empty((2, 0, problem.design.frequencies)))


def test_shares_of_the_misfit_add_to_one_and_go_with_the_squares():
    problem = toy(fourth)
    found = residuals(problem, problem.fit(), None, nothing(problem))
    share = np.array([each.share for each in found])
    percent = np.array([each.residual_percent for each in found])
    assert share.sum() == pytest.approx(1)
    assert share == pytest.approx(percent**2 / np.sum(percent**2), rel=0.05)
    assert {each.order for each in found if each.share > 0.05} == {4}


def test_z_is_that_of_a_datum_against_the_prediction_from_all_others():
    """z = (y - mean of the others) / sqrt(sd^2 + var of that mean) where one mean is free."""
    problem = toy(lambda design: 0.01 * (design.frequency_order == 1), modes=[(0, 1), (0, 2)])
    value = problem.observations.value
    found = residuals(problem, problem.fit(), None, nothing(problem))
    for i, each in enumerate(found):
        others = np.delete(value, i)
        apart = (value[i] - others.mean()) / np.sqrt(SD**2 + SD**2 / len(others))
        assert each.z == pytest.approx(apart, rel=1e-3)


def test_a_model_error_that_swallows_the_gap_does_not_hide_it():
    problem = toy(fourth)
    fits = problem.fit(), problem.fit(model_error=0.01)
    plain, swallowed = (
        max(r.z for r in residuals(problem, fit, None, nothing(problem))) for fit in fits
    )
    assert swallowed > 0.9 * plain > 7


def test_a_planted_trend_with_temperature_comes_out_with_its_slope_and_all_of_the_misfit():
    problem = toy(warmer)
    first = trends(problem, problem.fit())[0]
    assert first.condition == "temperature"
    assert first.slope_percent == pytest.approx(100 * 2e-4 * 20, rel=1e-3)
    assert first.share == pytest.approx(1, abs=1e-3)
    assert first.slope_sd_percent == pytest.approx(100 * SD * np.sqrt(400 / (200 * 12)), rel=1e-3)


def test_only_conditions_that_the_tests_vary_have_a_trend():
    one = toy(warmer, (Conditions("t1"),), [(0, 1), (0, 2)])
    assert {each.condition for each in trends(one, one.fit())} == {"order"}
    every = toy(warmer, campaign(AddedMass(25.0, 3.6)))
    varied = {"temperature", "amplitude", "added mass", "order", "plane"}
    assert {each.condition for each in trends(every, every.fit())} == varied


def test_a_test_with_other_modes_does_not_pass_for_a_trend_with_its_temperature():
    """The gap grows with the order only, and the warm test alone holds the high orders."""
    problem = toy(lambda design: 1e-3 * design.frequency_order)
    design = problem.observations.design
    missing = (design.frequency_order > 3) & (design.frequency_test < 2)
    sd = np.where(missing, 1e3, SD)
    problem = ToyProblem(Observations(design, problem.observations.value, sd), problem.slopes)
    found = {each.condition: each for each in trends(problem, problem.fit())}
    assert abs(found["temperature"].slope_percent) < 1e-3
    assert found["order"].slope_percent == pytest.approx(0.5, rel=1e-3)


def test_errors_that_a_fit_allows_for_beside_those_stated_keep_it_from_absorbing_them():
    """Slopes of 0.01 and supports that give (0.1) in a plane: hardly anything is absorbed."""
    problem = toy(lambda design: np.zeros(design.size))
    plane = (problem.design.frequency_plane == 1).astype(float)
    steep = ToyProblem(
        problem.observations, {Hypothesis(): lambda design: 0.01 * plane[: design.size, None]}
    )
    fit = steep.fit()
    raw = 100 * SD * np.sqrt(4 / 60)
    loose = replace(fit.noise, frequency=fit.noise.frequency + 0.1**2 * np.outer(plane, plane))
    alone, beside = (
        next(t.slope_sd_percent for t in trends(steep, each) if t.condition == "plane")
        for each in (fit, replace(fit, noise=loose))
    )
    assert alone < 0.8 * raw
    assert beside == pytest.approx(raw, rel=0.02)


def _p_values(gap: np.ndarray, count: int) -> np.ndarray:
    none = plain.fit(np.zeros(plain.design().size), plain.tension())
    found = []
    for seed in range(count):
        value = plain.noise(np.random.default_rng(seed)) + gap
        found.append(
            min(predictive_p_values(plain.observations(value), none.predicted[None], none.noise))
        )
    return np.array(found)


def test_data_of_the_hypothesis_are_seldom_found_odd() -> None:
    found = _p_values(np.zeros(plain.design().size), 200)
    assert np.mean(found < 0.05) <= 0.09
    assert np.median(found) > 0.3


def test_a_gap_that_repeats_is_found_though_each_test_hides_it() -> None:
    """And shapes that are off."""
    shapes = np.zeros(plain.design().size)
    shapes[plain.design().frequencies :: 2] = 1.5 * plain.SHAPE_SD
    for gap in (plain.stiffening(3e-4), shapes):
        assert np.median(_p_values(gap, 20)) < 0.01


def test_along_a_bent_ridge_of_end_springs_sound_data_are_not_odd_and_a_gap_is() -> None:
    """By the slopes at the best point draws had p = 0.008 here, 1e-190 in a blind case."""
    problem = problem_of(own_campaign(tests=1, modes=3, sd=1e-4), "beam2")
    fit = fit_alone(problem, np.random.default_rng(1))
    seen, gap = problem.observations.value, np.zeros(problem.design.size)
    gap[0] = 0.01
    predicted = predictions(problem, fit)
    for value, odd in ((seen, False), (seen + gap, True)):
        measured = replace(problem.observations, value=value)
        assert (min(predictive_p_values(measured, predicted, fit.noise)) < 0.1) is odd
