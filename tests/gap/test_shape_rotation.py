"""Modes whose direction is uncertain: what their standard deviations say, and what it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.gap.hypotheses.noise import nodes
from shm.gap.hypotheses.observations import observed, separate_turn, turn_of_axes
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.repeated_errors import ShapeScaling, turn_loads
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode
from tests.helpers.gap_campaigns import problem_of, simulated
from tests.helpers.hangers import HANGER_3

PLAN: dict[str, Any] = {"modes": 4, "as_made": False, "shape_sd": 1e-3, "hanger": HANGER_3}
APART = replace(
    HANGER_3,
    assumptions=HANGER_3.assumptions.with_numbers(plane_coupling=1e-6, out_of_round_sd=0.0),
)
"""Its planes are so far apart that none of its modes turns by itself."""
SIZE = np.array([0.1, 0.4, 1.0, 0.8])


@pytest.fixture(scope="module")
def test() -> ModalTest:
    return simulated(**PLAN, seed=4)[0]


def _may_be_turned(mode: Mode, rad: float) -> Mode:
    shape = tuple(replace(p, sd=float(np.hypot(p.sd, rad * p.value))) for p in mode.shape)
    return replace(mode, shape=shape)


def _by_sensors(mode: Mode, degrees: Sequence[float] = (0.0, 1.0, -1.0, 0.5)) -> Mode:
    """The mode as sensors see it that are turned by some degrees."""
    shape = [
        _turned(replace(mode, shape=(point,)), np.radians(angle)).shape[0]
        for point, angle in zip(mode.shape, degrees, strict=True)
    ]
    return replace(mode, shape=tuple(shape))


def _turned(mode: Mode, rad: float) -> Mode:
    """The mode turned about the hanger's axis, from transverse to longitudinal."""
    cosine, sine = np.cos(rad), np.sin(rad) * (1 if mode.plane == PLANES[0] else -1)
    shape = tuple(
        replace(p, value=cosine * p.value - sine * p.cross, cross=cosine * p.cross + sine * p.value)
        for p in mode.shape
    )
    return replace(mode, shape=shape)


@pytest.mark.parametrize(
    ("sd", "least", "expected_own", "expected_turn"),
    [
        (np.hypot(0.005, 0.1 * SIZE), 0.004, 0.005, 0.1),
        (np.full(4, 0.005), 0.005, None, 0.0),
        (np.array([0.0055, 0.005, 0.006, 0.0052]), 0.005, None, 0.0),
        (0.2 * SIZE, 0.005, 0.005, 0.2),
    ],
)
def test_what_grows_with_the_shape_is_the_turn(
    sd: FloatArray, least: float, expected_own: float | None, expected_turn: float
) -> None:
    """What does not grow stays as it is; own deviations are never smaller than the least."""
    own, turn = separate_turn(sd, SIZE, least)
    assert turn == pytest.approx(expected_turn, rel=0.01)
    assert own is sd if expected_own is None else own == pytest.approx(expected_own)


def test_without_turns_nothing_changes(test: ModalTest) -> None:
    found = observed([test], APART)
    assert found.turns is None
    assert turn_loads(found).shape == (64, 0)


@pytest.mark.parametrize("rad", [0.02, 0.3])
def test_a_turn_as_large_as_may_be_is_no_misfit(test: ModalTest, rad: float) -> None:
    """The chi-square of the shapes grows by one for it, and by far more where it is not stated."""

    def chi_square(mode: Mode) -> float:
        problem = problem_of([replace(test, modes=(mode, *rest))], hanger=APART)
        return _chi_square(problem, _shapes([test], APART))

    first, *rest = test.modes
    assert chi_square(_turned(_may_be_turned(first, rad), rad)) < 2
    assert chi_square(_turned(first, rad)) > 20


def _shapes(tests: list[ModalTest], hanger: Hanger) -> FloatArray:
    found = observed(tests, hanger)
    return found.value[found.design.frequencies :]


def _chi_square(problem: GapProblem, predicted: FloatArray) -> float:
    """The chi-square of the measured shapes about those predicted (S,)."""
    found = problem.observations
    covariance = nodes(found, problem.repeated)[0].covariance
    whole = np.diag(covariance.shape) + covariance.shape_loads @ covariance.shape_loads.T
    scaled = ShapeScaling.measured(found).scaled(predicted[None])[0]
    left = found.value[found.design.frequencies :] - scaled
    return float(left @ np.linalg.solve(whole, left))


def test_a_coupling_turns_a_pair_by_its_share_of_their_distance(test: ModalTest) -> None:
    """As the eigenvectors of two coupled oscillators; a lone mode as its neighbours."""
    coupling, hz, apart = HANGER_3.assumptions.plane_coupling.value, 7.0, 0.03
    lower, upper = np.log(hz), np.log(hz) + apart
    _, vectors = np.linalg.eigh(np.array([[lower, coupling], [coupling, upper]]))
    expected = abs(np.arctan(vectors[1, 0] / vectors[0, 0]))
    pair = [
        Mode(plane, 1, float(np.exp(at))) for plane, at in zip(PLANES, (lower, upper), strict=True)
    ]
    modes = (*pair, Mode(PLANES[0], 2, 15.0))
    turn = turn_of_axes(replace(test, modes=modes), HANGER_3)
    assert np.hypot(*turn[:, :2].T) == pytest.approx(np.full(3, expected), rel=0.01)
    alone = replace(test, modes=modes[:1])
    assert not turn_of_axes(alone, HANGER_3).any()


@pytest.mark.parametrize("degrees", [5.0, 40.0])
def test_a_pair_that_coincides_may_be_turned_freely(test: ModalTest, degrees: float) -> None:
    """And sensors by themselves, at once: nothing is left but their usual errors."""
    first, *rest = test.modes
    turned = replace(
        test, modes=tuple(map(_by_sensors, (_turned(first, np.radians(degrees)), *rest)))
    )
    close = replace(HANGER_3, assumptions=HANGER_3.assumptions.with_numbers(plane_coupling=0.2))
    problem = problem_of([turned], hanger=close)
    assert _chi_square(problem, _shapes([test], close)) < 4


@pytest.mark.parametrize("degrees", [15.0, 40.0])
def test_one_axis_of_all_modes_costs_once_and_hides_no_sensor(
    test: ModalTest, degrees: float
) -> None:
    """Nor says which of two groups of sensors it is that is turned."""
    close = replace(HANGER_3, assumptions=HANGER_3.assumptions.with_numbers(plane_coupling=0.1))
    straight = _shapes([test], close)

    def chi_square(*sensors: float) -> float:
        """Of modes that swing askew, as sensors see them that are turned by so many degrees."""
        modes = tuple(_by_sensors(_turned(m, np.radians(degrees)), sensors) for m in test.modes)
        return _chi_square(problem_of([replace(test, modes=modes)], hanger=close), straight)

    alike, apart = chi_square(0.0, 0.0, 0.0, 0.0), chi_square(0.0, 15.0, 0.0, 15.0)
    assert alike < 2
    assert apart > alike + 50
    assert chi_square(15.0, 0.0, 15.0, 0.0) == pytest.approx(apart, rel=0.1)


def test_without_the_shape_of_one_mode_the_others_may_still_be_turned(test: ModalTest) -> None:
    first, *rest = (_may_be_turned(mode, 0.3) for mode in test.modes)
    turned = replace(test, modes=(first, *rest))
    whole = problem_of([turned], hanger=HANGER_3)
    without = whole.without_shape(0).observations
    others = whole.observations.design.shape_mode != 0
    _, *of_others = turn_loads(whole.observations)[others].T
    # A sum over fewer components rounds otherwise; what is no load of a mode is 0 in both.
    np.testing.assert_allclose(turn_loads(without), np.column_stack(of_others), rtol=1e-13)
