"""The recursions of the local levels against one large normal law without any recursion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from shm.values import FloatArray
from shm.watch.local_level import Course, LocalLevels


def course(tests: int, quantities: int, seed: int) -> Course:
    """Readings along turned directions, some not seen, some by outliers, with a jump halfway."""
    rng = np.random.default_rng(seed)
    shape = tests, quantities
    turned = [np.linalg.qr(rng.normal(size=(quantities, quantities)))[0] for _ in range(tests)]
    seen = np.where(rng.random(shape) < 0.2, np.nan, rng.normal(0, 0.5, shape))
    jumps = np.zeros(shape)
    jumps[[0, tests // 2]] = 0.02
    return Course(
        seen=seen,
        directions=30 * np.stack(turned),
        variance=rng.uniform(0.01, 1, shape),
        warmth_k=rng.normal(0, 8, tests),
        extra_variance=np.where(rng.random(shape) < 0.2, 1e-4, 0.0),
        inflation=np.where(rng.random(tests) < 0.2, 50.0, 1.0),
        years=rng.uniform(0.05, 0.5, tests - 1),
        jump_variance=jumps,
        coefficient_sd=np.full(quantities, 0.004),
        rate=np.full(quantities, 0.005),
        scatter=np.full(quantities, 0.002),
        rate_log_sd=1.5,
        scatter_log_sd=1.0,
    )


def one_law(given: Course, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Prior covariance of levels at all tests and of coefficients; what sees them, noise, seen."""
    tests, quantities = given.seen.shape
    rate, scatter = LocalLevels(given).rate_and_scatter(z)
    steps = given.jump_variance.copy()
    steps[1:] += given.years[:, None] * rate**2
    wandered = np.cumsum(steps, axis=0)
    prior = np.zeros((tests * quantities + quantities,) * 2)
    for j in range(quantities):
        at = np.arange(tests) * quantities + j
        prior[np.ix_(at, at)] = np.minimum.outer(wandered[:, j], wandered[:, j])
        prior[tests * quantities + j, tests * quantities + j] = given.coefficient_sd[j] ** 2
    warmed = np.concatenate(given.directions * given.warmth_k[:, None, None])
    sees = np.hstack([block_diag(*given.directions), warmed])
    noises = [
        factor * (turn @ np.diag(extra + scatter**2) @ turn.T + np.diag(own))
        for factor, turn, extra, own in zip(
            given.inflation, given.directions, given.extra_variance, given.variance, strict=True
        )
    ]
    there = np.isfinite(given.seen).ravel()
    noise = block_diag(*noises)[np.ix_(there, there)]
    return prior, sees[there], noise, given.seen.ravel()[there]


@pytest.mark.parametrize(("tests", "quantities"), [(1, 1), (7, 1), (9, 3)])
def test_misfits_differ_as_those_of_the_whole_law(tests: int, quantities: int) -> None:
    given = course(tests, quantities, seed=5)
    several = np.random.default_rng(6).normal(size=(4, 2 * quantities))
    expected = []
    for z in several:
        prior, sees, noise, seen = one_law(given, z)
        density = multivariate_normal.logpdf(
            seen, np.zeros(len(seen)), sees @ prior @ sees.T + noise
        )
        expected.append(z @ z / 2 - density)
    found = LocalLevels(given).misfits(several)
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("tests", "quantities"), [(1, 1), (7, 1), (9, 3)])
def test_smoothed_states_are_those_of_the_whole_law(tests: int, quantities: int) -> None:
    given = course(tests, quantities, seed=7)
    z = np.random.default_rng(8).normal(size=2 * quantities)
    prior, sees, noise, seen = one_law(given, z)
    gain = np.linalg.solve(sees @ prior @ sees.T + noise, sees @ prior).T
    mean, covariance = gain @ seen, prior - gain @ sees @ prior
    found = LocalLevels(given).smoothed(z[None])
    coefficients = np.arange(tests * quantities, tests * quantities + quantities)
    for test in range(tests):
        at = np.concatenate([np.arange(quantities) + test * quantities, coefficients])
        np.testing.assert_allclose(found.smoothed_mean[0, test], mean[at], rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(
            found.smoothed_covariance[0, test], covariance[np.ix_(at, at)], rtol=1e-6, atol=1e-13
        )
    last = np.concatenate([np.arange(quantities) + (tests - 1) * quantities, coefficients])
    np.testing.assert_allclose(found.filtered_mean[0, -1], mean[last], rtol=1e-7, atol=1e-12)


def test_the_best_parameters_are_a_minimum() -> None:
    model = LocalLevels(course(20, 2, seed=9))
    best = model.fitted()
    around = best + 0.3 * np.concatenate([np.eye(4), -np.eye(4)])
    assert np.all(model.misfits(around) > model.misfits(best[None]))
