"""The recursions of the local levels against one large normal law without any recursion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from shm.values import FloatArray
from shm.watch.state import LocalLevels, StateOptions


def levels(tests: int, quantities: int, seed: int) -> LocalLevels:
    """Readings of which some see nothing, some are outliers, with a jump halfway."""
    rng = np.random.default_rng(seed)
    roots = rng.normal(0, 2, (tests, quantities, quantities))
    information = roots @ np.swapaxes(roots, 1, 2)
    information[rng.random(tests) < 0.2] = 0.0
    jump = np.zeros(tests)
    jump[[0, tests // 2]] = 0.5
    return LocalLevels(
        mean=rng.normal(0, 0.5, (tests, quantities)),
        information=information,
        warmth_k=rng.normal(0, 8, tests),
        unknown_k=np.where(rng.random(tests) < 0.2, 10.0, 0.0),
        unknown_square=np.full(quantities, 0.01**2),
        inflation=np.where(rng.random(tests) < 0.2, 50.0, 1.0),
        years=np.append(0.0, rng.uniform(0.05, 0.5, tests - 1)),
        jump=jump,
        coefficient_sd=np.full(quantities, 0.08),
        step=np.ones(quantities),
        reference_c=10.0,
        options=StateOptions(),
    )


def one_law(
    given: LocalLevels, z: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Prior covariance of levels at all tests and of coefficients; what sees them, noise, seen."""
    tests, q = given.mean.shape
    rate, scatter = given.rate_and_scatter(z)
    wandered = np.cumsum(given.jump[:, None] + given.years[:, None] * rate**2, axis=0)
    prior = np.zeros((tests * q + q,) * 2)
    for j in range(q):
        at = np.arange(tests) * q + j
        prior[np.ix_(at, at)] = np.minimum.outer(wandered[:, j], wandered[:, j])
        prior[tests * q + j, tests * q + j] = given.coefficient_sd[j] ** 2
    sees = np.hstack([np.eye(tests * q), np.kron(given.warmth_k[:, None], np.eye(q))])
    noise = given.unknown_k[:, None] ** 2 * given.unknown_square + scatter**2
    seen = np.repeat(given.information.any(axis=(1, 2)), q)
    own = [np.linalg.inv(each) if each.any() else np.eye(q) for each in given.information]
    whole = block_diag(
        *(f * (a + np.diag(b)) for f, a, b in zip(given.inflation, own, noise, strict=True))
    )
    return prior, sees[seen], whole[np.ix_(seen, seen)], given.mean.ravel()[seen]


@pytest.mark.parametrize(("tests", "quantities"), [(1, 1), (7, 1), (9, 3)])
def test_misfits_differ_as_those_of_the_whole_law(tests: int, quantities: int) -> None:
    given = levels(tests, quantities, seed=5)
    several = np.random.default_rng(6).normal(size=(4, 2 * quantities))
    expected = []
    for z in several:
        prior, sees, noise, seen = one_law(given, z)
        law = multivariate_normal(np.zeros(len(seen)), sees @ prior @ sees.T + noise)
        expected.append(z @ z / 2 - law.logpdf(seen))
    np.testing.assert_allclose(np.diff(given.misfit(several)), np.diff(expected), 1e-8, 1e-8)


@pytest.mark.parametrize(("tests", "quantities"), [(1, 1), (7, 1), (9, 3)])
def test_smoothed_states_are_those_of_the_whole_law(tests: int, quantities: int) -> None:
    given = levels(tests, quantities, seed=7)
    z = np.random.default_rng(8).normal(size=2 * quantities)
    prior, sees, noise, seen = one_law(given, z)
    gain = np.linalg.solve(sees @ prior @ sees.T + noise, sees @ prior).T
    mean, covariance = gain @ seen, prior - gain @ sees @ prior
    made = given._filtered(z[None])[1]
    means, covariances = given._smoothed(made)
    for test in range(tests):
        at = np.r_[np.arange(quantities) + test * quantities, tests * quantities : len(mean)]
        np.testing.assert_allclose(means[0, test], mean[at], 1e-6, 1e-10)
        np.testing.assert_allclose(covariances[0, test], covariance[np.ix_(at, at)], 1e-6, 1e-10)
    np.testing.assert_allclose(made[-1][2][0], mean[at], 1e-6, 1e-10)


def test_the_best_parameters_are_a_minimum() -> None:
    model = levels(20, 2, seed=9)
    best = model.fitted()
    around = best + 0.3 * np.concatenate([np.eye(4), -np.eye(4)])
    assert np.all(model.misfit(around) > model.misfit(best[None]))
