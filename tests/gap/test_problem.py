"""What a hypothesis predicts of tests: rows, scale and sign of shapes, subsets, other designs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from shm.gap.hypotheses.contract import Hypothesis
from shm.gap.hypotheses.coordinates import Coordinates, cut
from shm.gap.hypotheses.problem import GapProblem
from shm.models.classes.base import point_mass
from shm.models.effects import Parameter, Variant
from shm.models.hanger import solve
from tests.helpers.gap_campaigns import HANGER, campaign, problem_of

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
    made = problem_of(tests)
    straight = replace(made.observations, turns=None)
    problem = GapProblem(made.model, made.tests, straight)
    design, value = problem.design, problem.observations.value
    predicted = problem.predict(BASELINE, problem.near)
    for mode in range(design.frequencies):
        rows = design.frequencies + np.flatnonzero(design.shape_mode == mode)
        assert np.linalg.norm(predicted[0, rows]) == pytest.approx(1)
        assert predicted[0, rows] @ value[rows] > 0.99


INF, NAN = np.inf, np.nan
SIGNED = Parameter("change", "", 0.001, 0.1, 0.0, "", "logarithmic", signed=True)
SIZE = Parameter("mass_kg", "kg", 0.01, 10.0, 0.0, "", "logarithmic")
SPRING = Parameter("log10_k", "N m/rad", 5.0, 9.0, INF, "")
PLACE = Parameter("x_m", "m", 0.0, 12.0, NAN, "")


def _coordinates(*effect: Parameter) -> Coordinates:
    return Coordinates(problem_of(campaign(tests=1)).described, effect)


def test_effect_values_follow_priors_and_back() -> None:
    """Normal draws of z follow the uniform and logarithmic priors (Kolmogorov-Smirnov)."""
    own = _coordinates(SIGNED, SIZE, SPRING, PLACE)
    z = np.random.default_rng(1).standard_normal((2000, own.dimension))
    change, mass, _, place = own.effect_values(z).T
    for sample, exact in (
        (np.log10(mass), stats.uniform(-2, 3)),
        (np.log10(np.abs(change)), stats.uniform(-3, 2)),
        (place, stats.uniform(0, 12)),
    ):
        assert stats.kstest(sample, exact.cdf).pvalue > 1e-3
    assert abs((change > 0).mean() - 0.5) < 0.05
    z = z[:50].clip(-2.5, 2.5)
    found = own.effect_z(own.effect_values(z), own.baseline)
    np.testing.assert_allclose(found, z[:, own.baseline :], atol=1e-8)


def test_drawn_differs_in_the_unseen_alone() -> None:
    """Frequencies at rest of what is drawn are those at its middle."""
    problem = problem_of(campaign(tests=1))
    own = problem.coordinates(Hypothesis())
    z = 0.5 * np.random.default_rng(3).standard_normal((20, own.dimension))
    middle, drawn = own.theta(z), own.drawn(z, np.random.default_rng(4))
    assert (drawn != middle).any(axis=1).all()
    frequency = [problem.model.frequencies_hz(each, 4) for each in (middle, drawn)]
    np.testing.assert_allclose(frequency[1], frequency[0], rtol=2e-3)


@pytest.mark.parametrize(
    ("parameter", "lower", "upper"),
    [
        (SIZE, 0.01 * 1000**0.25, 10.0),
        (SIGNED, 0.001 * 100**0.25, 0.1),
        (SPRING, 5.0, 8.0),
        (PLACE, 0.0, 12.0),
    ],
)
def test_cut_end_nearest_no_effect(parameter: Parameter, lower: float, upper: float) -> None:
    """Of sizes alone, and never all of one."""
    found = cut(parameter, 0.25)
    assert (found.lower, found.upper) == (pytest.approx(lower), pytest.approx(upper))
    assert cut(parameter, 1.0).lower < cut(parameter, 1.0).upper


def test_a_part_predicts_the_same_rows_of_the_data() -> None:
    problem = problem_of(campaign(shape_sd=0.01))
    kept = problem.design.frequency_order != 3
    part = problem.part(kept)
    whole = np.concatenate([kept, kept[problem.design.shape_mode]])
    z = np.random.default_rng(3).standard_normal((2, problem.dimension(MASS)))
    np.testing.assert_array_equal(part.observations.value, problem.observations.value[whole])
    np.testing.assert_allclose(part.predict(MASS, z), problem.predict(MASS, z)[:, whole])
    assert part.design.survey is problem.design.survey


def test_magnitude_from_no_effect() -> None:
    own = _coordinates(SIGNED, SPRING)
    np.testing.assert_allclose(own.magnitude(np.array([[-0.01, 9.0], [0.001, 6.0]])), [0.5, 0.75])
    assert _coordinates(PLACE).magnitude(np.array([[3.0]])).tolist() == [1.0]
