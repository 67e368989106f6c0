"""A test counts where it agrees with what was before it or with one beside it."""

from __future__ import annotations

import numpy as np
import pytest

from shm.values import BoolArray, FloatArray
from shm.watch.isolated_tests import Seen, outlier_probability, select_consistent_tests

MODES, SD = 6, 1e-3


def seen(levels: FloatArray, seed: int = 0) -> Seen:
    """Tests at `levels` (tests,), alike in all modes."""
    rng = np.random.default_rng(seed)
    values = levels[:, None] + SD * rng.standard_normal((len(levels), MODES))
    return Seen(
        values=values,
        variances=np.full(values.shape, SD**2),
        doubt=np.zeros(values.shape),
        factors=np.ones((MODES, 1)),
        sds=np.array([2e-3]),
    )


def in_turn(given: FloatArray, baseline_tests: int = 1) -> BoolArray:
    """Who counts, each test asked of as it comes."""
    every, known = seen(np.array(given)), np.zeros(0, bool)
    for tests in range(1, len(given) + 1):
        part = Seen(
            every.values[:tests], every.variances[:tests], every.doubt[:tests],
            every.factors, every.sds,
        )  # fmt: skip
        known = select_consistent_tests(part, known, baseline_tests)
    return known


@pytest.mark.parametrize("off", [0.05, -0.3, 5.0])
def test_a_wild_test_counts_only_once_another_agrees_with_it(off: float) -> None:
    alone = in_turn(np.array([0, 0, 0, off, 0, 0.0]))
    last = in_turn(np.array([0, 0, 0, off]))
    both = in_turn(np.array([0, 0, 0, off, off]))
    between = in_turn(np.array([0, 0, 0, off, -2 * off, off]))

    assert alone.tolist() == [True, True, True, False, True, True]
    assert not last[3]
    assert both.all()
    assert between.tolist() == [True, True, True, True, False, True]


def test_two_wild_tests_that_differ_count_for_nothing() -> None:
    assert in_turn(np.array([0, 0, 0, 0.1, -0.1, 0])).tolist() == [1, 1, 1, 0, 0, 1]


def test_what_was_found_stays_once_two_tests_have_followed() -> None:
    late = in_turn(np.array([0, 0, 0, 0.1, 0, 0, 0.1, 0.1, 0.1]))

    assert late.tolist() == [1, 1, 1, 0, 1, 1, 1, 1, 1]


def test_a_blunder_of_the_baseline_does_not_count() -> None:
    assert in_turn(np.array([0, 0.2, 0, 0, 0, 0]), 5).tolist() == [1, 0, 1, 1, 1, 1]


def test_a_test_without_modes_in_common_agrees_with_none() -> None:
    given = seen(np.zeros(2))
    given.variances[0, :3] = given.variances[1, 3:] = np.inf

    assert given.distance(0, 1) == (0.0, 0, 0.0)
    assert not given.agree(0, 1)
    assert outlier_probability(given, np.ones(2, bool), 1, 0.01) == 0.01


def test_what_an_unknown_temperature_does_is_allowed_for() -> None:
    apart = seen(np.array([0.0, 0.03]))
    assert not apart.agree(0, 1)
    apart.doubt[1] = 0.02
    assert apart.agree(0, 1)


def test_the_probability_of_a_blunder_grows_with_its_distance() -> None:
    given = seen(np.array([0.0, 0.0, 0.005, 0.01, 0.02, 0.2]))
    found = [outlier_probability(given, np.arange(6) == 0, test, 0.01) for test in range(1, 6)]

    assert found == sorted(found)
    assert found[0] < 0.01 < 0.99 < found[-1]


def test_a_mistaken_mode_that_no_test_beside_it_has_lets_the_test_count_for_nothing() -> None:
    """By the modes that they share it agrees with its neighbours: these lack the mistaken one."""
    every = seen(np.zeros(8))
    variances = every.variances.copy()
    variances[[3, 5], 2] = np.inf
    strayed, lasts = every.values.copy(), every.values.copy()
    strayed[4, 2] += 0.12
    lasts[4:, 2] += 0.12

    def count(values: FloatArray) -> list[bool]:
        part = Seen(values, variances, every.doubt, every.factors, every.sds)
        return [bool(each) for each in select_consistent_tests(part, np.zeros(0, bool), 1)]

    assert count(every.values) == [True] * 8
    assert count(strayed) == [n != 4 for n in range(8)]
    assert count(lasts)[6:] == [True, True], "what lasts counts once another test has it"
