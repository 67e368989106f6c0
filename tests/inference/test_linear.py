"""Linear parameters integrated out, against the normal distribution itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from shm.inference.sampler.likelihood import Covariance, Likelihood, NoiseNode
from shm.inference.sampler.linear import Linear

F, S, L = 6, 4, 3
RNG = np.random.default_rng(2)
SLOPES = RNG.standard_normal((F + S, L))
ROOT = RNG.standard_normal((F, F))
LOADS = RNG.standard_normal((S, 2))
COVARIANCES = [
    Covariance(size * ROOT @ ROOT.T + np.eye(F), size * np.full(S, 0.5), LOADS)
    for size in (0.5, 2.0)
]
SHARES = (0.3, 0.7)


def whole(errors: Covariance) -> np.ndarray:
    both = np.zeros((F + S, F + S))
    both[:F, :F] = errors.frequency
    both[F:, F:] = np.diag(errors.shape) + errors.shape_loads @ errors.shape_loads.T
    return both


@pytest.fixture
def linear() -> Linear:
    nodes = [
        NoiseNode(each, float(np.log(share)), 0.0)
        for each, share in zip(COVARIANCES, SHARES, strict=True)
    ]
    return Linear(Likelihood(nodes), SLOPES)


def test_marginal_is_normal(linear: Linear) -> None:
    """Residuals at z are y - J z: y is normal about 0 with covariance C + J J'."""
    z, value = RNG.standard_normal((5, L)), RNG.standard_normal((5, F + S))
    log, step, node = linear.marginal(value - z @ SLOPES.T, z)
    by_node = [
        np.log(share) + stats.multivariate_normal.logpdf(value, cov=whole(each) + SLOPES @ SLOPES.T)
        for each, share in zip(COVARIANCES, SHARES, strict=True)
    ]
    np.testing.assert_allclose(log, logsumexp(by_node, axis=0), rtol=1e-9)
    np.testing.assert_array_equal(node, np.argmax(by_node, axis=0))
    for k in range(5):
        pull = SLOPES.T @ np.linalg.inv(whole(COVARIANCES[node[k]]))
        best = np.linalg.solve(np.eye(L) + pull @ SLOPES, pull @ value[k])
        np.testing.assert_allclose(z[k] + step[k], best, rtol=1e-9)


def test_marginal_unsolved_model(linear: Linear) -> None:
    log, step, _ = linear.marginal(np.full((1, F + S), np.nan), np.zeros((1, L)))
    assert log[0] == -np.inf
    assert not step.any()


def test_visible_beyond_what_follows(linear: Linear) -> None:
    """d' (C + J J')^-1 d of a shift d."""
    shift = RNG.standard_normal((4, F + S))
    for node, errors in enumerate(COVARIANCES):
        inverse = np.linalg.inv(whole(errors) + SLOPES @ SLOPES.T)
        exact = np.sqrt(np.einsum("ni,ij,nj->n", shift, inverse, shift))
        np.testing.assert_allclose(linear.visible(shift, node), exact, rtol=1e-9)
