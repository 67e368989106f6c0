"""Draws of several proposals against one target whose integral is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from shm.inference.mixture import Pool, effective, normalised
from shm.values import FloatArray


@dataclass(frozen=True, eq=False)
class Drawn:
    w: FloatArray

    def joined(self, other: Drawn) -> Drawn:
        return Drawn(np.vstack([self.w, other.w]))


def log_density(centre: FloatArray, drawn: Drawn) -> FloatArray:
    return np.asarray(stats.multivariate_normal(centre, 0.3 * np.eye(2)).logpdf(drawn.w))


def log_target(drawn: Drawn) -> FloatArray:
    return np.asarray(stats.multivariate_normal([0.5, 0.5], 0.2 * np.eye(2)).logpdf(drawn.w))


def added(pool: Pool[FloatArray, Drawn], centre: FloatArray, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = Drawn(rng.multivariate_normal(centre, 0.3 * np.eye(2), count))
    pool.add(centre, count, drawn, log_target(drawn))


def test_draws_of_several_proposals_count_as_draws_of_their_mixture() -> None:
    """A first proposal that went astray costs its draws, not the answer."""
    pool: Pool[FloatArray, Drawn] = Pool(log_density)
    added(pool, np.array([3.0, 3.0]), 500, 1)
    added(pool, np.array([0.5, 0.5]), 3000, 2)
    assert pool.draws == 3500
    assert effective(normalised(pool.log_weights)) > 1500
    assert logsumexp(pool.log_weights) - np.log(3500) == pytest.approx(0.0, abs=0.05)


def test_a_pool_that_absorbs_another_is_one_of_all_draws() -> None:
    one, other, whole = (Pool[FloatArray, Drawn](log_density) for _ in range(3))
    centres = np.array([[0.0, 0.0], [1.0, 1.0]])
    for index, pool in enumerate((one, other)):
        added(pool, centres[index], 400, index)
        added(whole, centres[index], 400, index)
    one.absorb(other)
    np.testing.assert_allclose(one.log_weights, whole.log_weights)
    np.testing.assert_array_equal(one.batch.w, whole.batch.w)


def test_draws_that_were_not_kept_count() -> None:
    """Of 1000 draws those outside of a half plane weigh nothing; the target lies inside."""
    pool: Pool[FloatArray, Drawn] = Pool(log_density)
    w = np.random.default_rng(3).multivariate_normal([0.5, 0.5], 0.3 * np.eye(2), 20_000)
    drawn = Drawn(w[w[:, 0] > 0.5])
    pool.add(np.array([0.5, 0.5]), len(w), drawn, log_target(drawn))
    assert np.exp(logsumexp(pool.log_weights)) / pool.draws == pytest.approx(0.5, abs=0.01)
