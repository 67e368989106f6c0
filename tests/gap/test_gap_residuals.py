"""Residuals and trends against closed forms of a linear toy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Hypothesis, Observations
from shm.gap.residuals import HeldOut, identification_sd, residuals, trends
from shm.models.effects import Conditions
from shm.values import NAN, AddedMass
from tests.helpers.toy_gap import SD, ToyProblem, campaign, design_of, tension

MODES = [(plane, order) for plane in (0, 1) for order in range(1, 7)]


def toy(gap, conditions=None, modes=MODES, noise=0.0, seed=1):
    """Measured: the toy's prediction, plus `gap` (frequencies,) and noise."""
    design = design_of(conditions or campaign(), modes)
    error = noise * np.random.default_rng(seed).standard_normal(design.size)
    value = 0.05 + gap(design) + error
    return ToyProblem(
        Observations(design, value, np.full(design.size, SD)), {Hypothesis(): tension}
    )


def nothing(problem):
    """Of which nothing is held out."""
    return HeldOut(*np.empty((2, 0, problem.design.frequencies)))


def warmer(design):
    return (
        2e-4 * np.array([c.temperature_shift_k for c in design.conditions])[design.frequency_test]
    )


def test_shares_of_the_misfit_add_to_one_and_go_with_the_squares():
    problem = toy(lambda design: 0.01 * (design.frequency_order == 4))
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
    problem = toy(lambda design: 0.01 * (design.frequency_order == 4))
    fits = problem.fit(), problem.fit(model_error=0.01)
    plain, swallowed = (
        max(r.z for r in residuals(problem, fit, None, nothing(problem))) for fit in fits
    )
    assert swallowed > 0.9 * plain > 7


def test_unknown_standard_deviations_are_those_that_the_leading_fit_finds():
    problem = toy(lambda design: np.zeros(design.size))
    unknown = Observations(problem.design, problem.observations.value, np.full(60, NAN))
    found = identification_sd(ToyProblem(unknown, problem.slopes), problem.fit())
    assert found == pytest.approx(np.full(60, SD))


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
    assert {each.condition for each in trends(every, every.fit())} == {
        "temperature",
        "amplitude",
        "added mass",
        "order",
        "plane",
    }


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
    (alone,) = (t.slope_sd_percent for t in trends(steep, fit) if t.condition == "plane")
    loose = replace(fit.noise, frequency=fit.noise.frequency + 0.1**2 * np.outer(plane, plane))
    (beside,) = (
        t.slope_sd_percent
        for t in trends(steep, replace(fit, noise=loose))
        if t.condition == "plane"
    )
    assert alone < 0.8 * raw
    assert beside == pytest.approx(raw, rel=0.02)
