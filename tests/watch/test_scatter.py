"""By how much tests of one state differ is learnt along what they differ."""

from __future__ import annotations

import numpy as np
import pytest

from shm.values import FloatArray
from shm.watch.history import learn_scatter
from shm.watch.options import WatchOptions

MODES, NOISE = 8, 1e-4
FACTORS = np.random.default_rng(2).standard_normal((MODES, 3))
ABSENT = np.zeros((MODES, 1))
PRIOR = np.array([1e-3, 1e-3, 1e-3, 5e-4]) ** 2


def scattered(tests: int, sds: FloatArray, seed: int = 0) -> FloatArray:
    """Of one state (tests, modes)."""
    rng = np.random.default_rng(seed)
    along = rng.standard_normal((tests, len(sds))) * sds
    return along @ FACTORS.T + NOISE * rng.standard_normal((tests, MODES))


def found(values: FloatArray, variances: FloatArray | None = None) -> FloatArray:
    tests = len(values)
    variances = np.full(values.shape, NOISE**2) if variances is None else variances
    factors = np.broadcast_to(np.hstack([FACTORS, ABSENT]), (tests, MODES, 4))
    spread = variances[1:] + variances[:-1]
    known = np.isfinite(spread)
    moved = np.where(known, np.diff(values, axis=0), 0.0)
    covariance = np.where(known, spread, 1e8)[:, :, None] * np.eye(MODES)
    along = np.where(known[:, :, None], factors[1:], 0.0)
    variance = PRIOR
    for _ in range(4):
        variance = learn_scatter(moved, covariance, along, (PRIOR, variance), WatchOptions())
    return np.sqrt(variance)


def test_planted_scatter_is_recovered_and_what_no_test_shows_stays_as_assumed() -> None:
    planted = np.array([2e-3, 5e-4, 1.5e-3])
    sds = found(scattered(400, planted))

    # An sd by 400 tests is known to 4 %, by their differences a little less.
    assert sds[:3] == pytest.approx(planted, rel=0.15)
    assert sds[3] == pytest.approx(5e-4, rel=1e-6)


def test_without_two_tests_the_scatter_is_as_assumed() -> None:
    assert found(scattered(1, np.full(3, 1e-2))) == pytest.approx(np.sqrt(PRIOR))


def test_a_mode_that_every_other_test_lacks_says_nothing_whatever_its_value() -> None:
    values = scattered(60, np.full(3, 1e-3))
    variances = np.full(values.shape, NOISE**2)
    variances[::2, 3] = np.inf
    wild = values.copy()
    wild[:, 3] += 0.5 * np.arange(60)

    assert found(wild, variances) == pytest.approx(found(values, variances), rel=1e-3)


@pytest.mark.parametrize("size", [0.02, 0.1, 0.5])
def test_one_lasting_step_hardly_counts_as_scatter_however_large(size: float) -> None:
    values = scattered(12, np.full(3, 1e-3))
    stepped = values.copy()
    stepped[6:] += size * FACTORS[:, 0]

    assert found(stepped)[0] < 2.5 * found(values)[0]
