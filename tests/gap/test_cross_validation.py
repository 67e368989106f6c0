"""What is held out, and what a right and a wrong cause then predict."""

from __future__ import annotations

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap.causes.residuals import held_out, shrinkage
from shm.gap.hypotheses.contract import Hypothesis, Observations
from shm.models.effects import Conditions, Variant
from shm.values import AddedMass
from tests.helpers.toy_gap import SD, ToyProblem, campaign, design_of, tension

MODES = [(plane, order) for plane in (0, 1) for order in range(1, 9)]
RIGHT = Hypothesis((("bending_stiffness", Variant()),))
WRONG = Hypothesis((("point_mass", Variant()),))
ONE_TEST = Hypothesis((("timebase", Variant("test t3", test="t3")),))


def with_stiffness(design):
    """The second parameter raises high orders, and does nothing to shapes."""
    grows = np.zeros((design.size, 1))
    grows[: design.frequencies, 0] = 0.002 * design.frequency_order**2
    return np.hstack([tension(design), grows])


def overfitted(design):
    """Every datum has a parameter of its own: it follows all and predicts nothing."""
    return np.hstack([tension(design), 0.1 * np.eye(design.size)])


SLOPES = {Hypothesis(): tension, RIGHT: with_stiffness, WRONG: overfitted, ONE_TEST: with_stiffness}


def toy(conditions=None, modes=MODES, stiffer=0.5, places_m=(), seed=1):
    design = design_of(conditions or campaign(), modes, places_m)
    error = SD * np.random.default_rng(seed).standard_normal(design.size)
    value = with_stiffness(design) @ [0.4, stiffer] + error
    return ToyProblem(Observations(design, value, np.full(design.size, SD)), SLOPES)


def held(problem, after=RIGHT, hold_out=()):
    fits = problem.fit(), problem.fit(after)
    return held_out(problem, *fits, hold_out)


def shrunk(problem, after):
    fits = problem.fit(), problem.fit(after)
    return shrinkage(problem, *fits, held(problem, after))


def test_only_the_right_cause_shrinks_the_gap_on_what_was_held_out():
    right, wrong = (shrunk(toy(), each) for each in (RIGHT, WRONG))
    assert right.rms_before_percent > 1
    assert right.held_out_before_percent > 1
    assert right.rms_after_percent == pytest.approx(100 * SD, rel=0.3)
    assert right.held_out_after_percent == pytest.approx(100 * SD, rel=0.4)
    assert wrong.rms_after_percent < 0.1 * wrong.rms_before_percent
    assert wrong.held_out_after_percent > 0.9 * wrong.held_out_before_percent


def test_a_held_out_residual_is_that_of_a_fit_that_never_saw_the_datum():
    """Changing a held-out frequency, or its shape, changes its residual by as much and no other."""
    problem = toy(places_m=(3.0, 6.0))
    design = problem.observations.design
    before = held(problem, hold_out=("4",))
    value = problem.observations.value.copy()
    rows = np.flatnonzero(design.frequency_order == 4)
    shapes = design.frequencies + np.flatnonzero(np.isin(design.shape_mode, rows))
    value[rows] += 0.3
    value[shapes] += 0.3
    moved = ToyProblem(Observations(design, value, problem.observations.sd), SLOPES)
    after = held(moved, hold_out=("4",))
    assert after.after[0, rows] - before.after[0, rows] == pytest.approx(np.full(len(rows), 0.3))
    assert np.isfinite(before.after[0]).sum() == len(rows)


def test_every_order_but_the_outermost_is_held_out_once():
    problem = toy((Conditions("t1"),))
    order = problem.observations.design.frequency_order
    found = held(problem)
    assert np.array_equal(np.isfinite(found.before).sum(axis=0), (order > 1) & (order < 8))
    assert [set(order[rows]) for rows in np.isfinite(found.before)] == [{2, 5}, {3, 6}, {4, 7}]


@pytest.mark.parametrize(
    ("conditions", "after", "expected"),
    [
        # t6 alone has a known mass; without any of the others temperatures and levels still vary.
        (campaign(AddedMass(25.0, 3.6)), RIGHT, [[0], [1], [2], [3], [4]]),
        # A cause in one test alone is not asked to predict that test.
        (campaign(), ONE_TEST, [[0], [1], [3], [4]]),
    ],
)
def test_tests_are_held_out_while_the_others_vary_the_same_conditions(conditions, after, expected):
    problem = toy(conditions)
    test = problem.observations.design.frequency_test
    folds = np.isfinite(held(problem, after).before)
    parts = [(rows, sorted(set(test[rows].tolist()))) for rows in folds]
    whole = sorted(tests for rows, tests in parts if np.array_equal(rows, np.isin(test, tests)))
    assert whole == expected


def test_named_tests_and_orders_are_left_out_together():
    problem = toy()
    design = problem.observations.design
    rows = np.isfinite(held(problem, hold_out=("t2", "4")).before)
    assert rows.shape[0] == 1
    assert np.array_equal(rows[0], (design.frequency_test == 1) | (design.frequency_order == 4))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("t9",), "neither a test nor an order"),
        (("12",), "neither a test nor an order"),
        (("4", "five"), "neither a test nor an order"),
        (tuple("2345678"), "left to fit"),
    ],
)
def test_what_cannot_be_held_out_is_refused(names, said):
    with pytest.raises(UsageError, match=said):
        held(toy((Conditions("t1"),)), hold_out=names)


@pytest.mark.parametrize("modes", [[(0, 1), (0, 2), (0, 3)], [(0, 1), (1, 1)]])
def test_three_frequencies_or_fewer_cannot_be_held_out_and_say_so_by_nan(modes):
    found = shrunk(toy((Conditions("t1"),), modes), RIGHT)
    assert np.isnan([found.held_out_before_percent, found.held_out_after_percent]).all()
    assert found.rms_before_percent > 0
