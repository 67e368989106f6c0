from __future__ import annotations

import numpy as np
import pytest

from shm.identify.setup_merging.join_set_ups import pool_estimates
from shm.values import FloatArray


def _cover(between: float, own: float, set_ups: int) -> float:
    """How often a 90 % interval of the pooled value holds the truth, 0."""
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(800):
        values = rng.normal(0, np.hypot(between, own), set_ups)
        mean, sd = pool_estimates(values, np.full(set_ups, own))
        hits += abs(mean) < 1.645 * sd
    return hits / 800


def _pooled(values: list[float], sds: list[float]) -> FloatArray:
    return np.array(pool_estimates(np.array(values), np.array(sds)))


def test_set_ups_that_agree_are_averaged_by_their_precision() -> None:
    mean, sd = _pooled([1.0, 1.0, 1.0], [0.1, 0.1, 0.2])
    assert mean == pytest.approx(1.0)
    assert sd == pytest.approx(1 / np.sqrt(100 + 100 + 25))


def test_one_that_is_precise_by_chance_does_not_rule_the_others() -> None:
    mean, _ = _pooled([1.0, 2.0, 3.0], [1e-6, 1.0, 1.0])
    assert mean == pytest.approx(2.0)


@pytest.mark.parametrize(("between", "own"), [(0.0, 1.0), (1.0, 1.0), (3.0, 1.0)])
@pytest.mark.parametrize("set_ups", [2, 3, 6])
def test_intervals_hold_the_truth_whatever_set_ups_differ_by(
    between: float, own: float, set_ups: int
) -> None:
    assert 0.8 < _cover(between, own, set_ups) < 0.995


def test_without_any_standard_deviation_the_scatter_of_three_set_ups_tells() -> None:
    mean, sd = _pooled([1.0, 2.0, 3.0], [np.nan] * 3)
    assert mean == pytest.approx(2.0)
    assert sd == pytest.approx(1 / np.sqrt(3) * 2.92 / 1.645, rel=1e-3)
    assert np.isnan(_pooled([1.0, 2.0], [np.nan] * 2)[1])


def test_an_unknown_standard_deviation_counts_as_the_largest_known() -> None:
    some = _pooled([1.0, 1.1, 0.9], [0.3, 0.2, np.nan])
    np.testing.assert_allclose(some, _pooled([1.0, 1.1, 0.9], [0.3, np.sqrt(0.065), 0.3]), rtol=0.1)
    assert some[1] == pytest.approx(1 / np.sqrt(2 / 0.09 + 1 / 0.065))
