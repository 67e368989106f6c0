"""What a hypothesis predicts of tests: rows, scale and sign of shapes, subsets, other designs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.search import fit_alone
from shm.inference.likelihood import Likelihood
from shm.models.base import point_mass
from shm.models.effects import Variant
from shm.models.hanger import solve
from tests.helpers.gap_campaigns import HANGER, PLACES_M, campaign, problem_of

BASELINE = Hypothesis()
MASS = Hypothesis((("point_mass", Variant()),))


def test_frequencies_are_the_general_models() -> None:
    problem = problem_of(campaign())
    z = np.random.default_rng(1).standard_normal((3, problem.dimension(BASELINE)))
    predicted = problem.predict(BASELINE, z)
    theta = problem.coordinates(BASELINE).theta(z)
    design = problem.design
    predicted -= problem.usual_of(design)
    for test, conditions in enumerate(design.conditions):
        bar, mass = problem.model.physical(theta), conditions.added_mass
        if mass is not None:
            bar = replace(bar, masses=(*bar.masses, point_mass(HANGER, mass, len(theta))))
        found = solve(bar, 6, np.empty(0), shapes=False).frequency_hz
        rows = design.frequency_test == test
        exact = found[:, design.frequency_plane[rows], design.frequency_order[rows] - 1]
        np.testing.assert_allclose(predicted[:, rows], np.log(exact), rtol=1e-12)


def test_predicted_shapes_have_unit_length_and_the_measured_sign() -> None:
    tests = list(campaign(shape_sd=0.01))
    first = tests[0].modes[2]
    turned = replace(
        first, shape=tuple(replace(p, value=-p.value, cross=-p.cross) for p in first.shape)
    )
    tests[0] = replace(tests[0], modes=(*tests[0].modes[:2], turned, *tests[0].modes[3:]))
    problem = problem_of(tests)
    design, value = problem.design, problem.observations.value
    predicted = problem.predict(BASELINE, problem.near)
    for mode in range(design.frequencies):
        rows = design.frequencies + np.flatnonzero(design.shape_mode == mode)
        assert np.linalg.norm(predicted[0, rows]) == pytest.approx(1)
        assert predicted[0, rows] @ value[rows] > 0.99


def test_settle_keeps_straight_terms_linear() -> None:
    """What is taken as linear is so within a tenth of the likeliest errors."""
    problem = problem_of(campaign(shape_sd=0.01))
    fit = fit_alone(problem, np.random.default_rng(1))
    linear = problem.linear(BASELINE)
    assert set(problem.described.always_linear) < set(linear)
    errors = Likelihood.of(fit.noise, fit.model_error)
    for column in np.setdiff1d(linear, problem.described.always_linear):
        step = np.zeros((2, len(fit.z)))
        step[:, column] = np.sqrt(fit.covariance[column, column]) * np.array([1.0, -1.0])
        there, back = problem.predict(BASELINE, fit.z + step) - fit.predicted
        assert errors.squares((there + back)[None] / 2)[0, 0] < 0.1**2


def test_another_design_has_further_sensors_behind_those_of_the_survey() -> None:
    problem = problem_of(campaign(shape_sd=0.01))
    own = problem.design
    further = replace(
        own,
        places_m=(*PLACES_M, 11.0),
        shape_mode=np.append(own.shape_mode[own.shape_mode == 0], 0),
        shape_place=np.append(own.shape_place[own.shape_mode == 0], 4),
        shape_component=np.append(own.shape_component[own.shape_mode == 0], 0),
    )
    predicted = problem.predict(BASELINE, problem.near, further)
    shape = predicted[0, own.frequencies :]
    assert np.linalg.norm(shape) == pytest.approx(1)
    assert shape[-1] > 0
