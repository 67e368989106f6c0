"""Unknown errors integrated over nodes, and the likelihood that they make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.special import logsumexp

from shm.gap.contract import NoiseNode, Observations
from shm.gap.likelihood import Likelihood
from shm.gap.noise import MEAN_MODEL_ERROR, MODEL_ERROR_SCALE, SD_LOWER, SD_UPPER, nodes, same_mode
from shm.values import FloatArray
from tests.gap import linear_toy as toy


def _observations(sd: float | None = 2e-4) -> Observations:
    """The toy's, with another standard deviation of its frequencies, or with none."""
    found = toy.observations(np.zeros(toy.design().size))
    frequency = np.full(found.design.frequencies, np.nan if sd is None else sd)
    return replace(found, sd=np.concatenate([frequency, found.sd[found.design.frequencies :]]))


def _dense(found: tuple[NoiseNode, ...], residual: FloatArray) -> float:
    count = len(found[0].covariance.frequency)
    logs = [
        node.log_weight
        + stats.multivariate_normal.logpdf(residual[:count], None, node.covariance.frequency)
        + np.sum(stats.norm.logpdf(residual[count:], scale=np.sqrt(node.covariance.shape)))
        for node in found
    ]
    return float(logsumexp(logs))


@pytest.mark.parametrize("sd", [2e-4, None])
def test_the_weights_add_to_one(sd: float | None) -> None:
    assert logsumexp([node.log_weight for node in nodes(_observations(sd))]) == pytest.approx(0)


def test_a_model_error_is_one_number_for_a_mode_in_all_tests() -> None:
    found = _observations()
    same = same_mode(found.design)
    assert same.sum() == toy.TESTS * found.design.frequencies
    node = nodes(found)[-1]
    off = node.covariance.frequency[same.astype(bool) & ~np.eye(len(same), dtype=bool)]
    np.testing.assert_allclose(off, node.model_error**2)


def test_the_mean_model_error_is_that_of_its_prior() -> None:
    found = nodes(_observations())
    mean = sum(np.exp(node.log_weight) * node.model_error for node in found)
    assert mean == pytest.approx(MEAN_MODEL_ERROR, rel=0.1)


def test_the_model_error_is_integrated_right() -> None:
    """Closed form for one mode in one test: the integral over sigma by quadrature."""
    own = toy.design()
    few = replace(
        own,
        frequency_test=own.frequency_test[:1],
        frequency_plane=own.frequency_plane[:1],
        frequency_order=own.frequency_order[:1],
        shape_mode=own.shape_mode[:0],
        shape_place=own.shape_place[:0],
        shape_component=own.shape_component[:0],
    )
    found = Likelihood(nodes(Observations(few, np.zeros(1), np.array([1e-4]))))

    def integrand(sigma: float, residual: float) -> float:
        return float(
            stats.norm.pdf(residual, scale=np.hypot(1e-4, sigma))
            * stats.halfnorm.pdf(sigma, scale=MODEL_ERROR_SCALE)
        )

    for residual in (0.0, 1e-4, 3e-4):
        exact = integrate.quad(integrand, 0, 5e-4, (residual,), points=[5e-5, 1e-4])[0]
        assert found.log(np.array([[residual]]))[0] == pytest.approx(np.log(exact), abs=0.03)


def test_an_unknown_standard_deviation_is_integrated_over_its_range() -> None:
    """Closed form for N equal unknown standard deviations: a ratio of incomplete gammas."""
    found = _observations(None)
    own, count = Likelihood(nodes(found)), found.design.frequencies
    rng = np.random.default_rng(1)
    residual = np.zeros(found.design.size)
    residual[:count] = 3e-3 * rng.standard_normal(count)
    square = (residual[:count] ** 2).sum()
    tail = stats.gamma(count / 2, scale=2 / square)
    inside = tail.cdf(SD_LOWER**-2) - tail.cdf(SD_UPPER**-2)
    log_integral = (
        stats.gamma.logpdf(1, count / 2, scale=2 / square) + square / 2
    )  # log of the gamma density's constant
    exact = (
        np.log(inside)
        - log_integral
        - np.log(2 * np.log(SD_UPPER / SD_LOWER))
        - count / 2 * np.log(2 * np.pi)
        + np.sum(stats.norm.logpdf(0, scale=found.sd[count:]))
    )
    assert own.log(residual[None])[0] == pytest.approx(exact, abs=0.05)


def test_where_some_standard_deviations_are_unknown_both_unknowns_are_integrated() -> None:
    found = _observations()
    found.sd[:5] = np.nan
    kinds = nodes(found)
    assert logsumexp([node.log_weight for node in kinds]) == pytest.approx(0)
    known = {float(node.covariance.frequency[8, 8] - node.model_error**2) for node in kinds}
    assert max(known) - min(known) < 1e-15
    assert len({float(node.covariance.frequency[0, 0]) for node in kinds}) == len(kinds)


@pytest.mark.parametrize("shuffled", [False, True])
def test_the_likelihood_is_that_of_the_full_covariance(shuffled: bool) -> None:
    found = _observations()
    rng = np.random.default_rng(2)
    kinds = nodes(found)
    if shuffled:
        order = rng.permutation(found.design.frequencies)
        kinds = tuple(
            replace(
                node,
                covariance=replace(
                    node.covariance, frequency=node.covariance.frequency[np.ix_(order, order)]
                ),
            )
            for node in kinds
        )
    residual = found.sd * rng.standard_normal((3, found.design.size))
    exact = [_dense(kinds, each) for each in residual]
    np.testing.assert_allclose(Likelihood(kinds).log(residual), exact, rtol=1e-9)


def test_products_are_those_of_the_full_covariance() -> None:
    found, rng = _observations(), np.random.default_rng(3)
    kinds = nodes(found)
    own = Likelihood(kinds)
    columns = rng.standard_normal((found.design.size, 3))
    count = found.design.frequencies
    weighed = own.weighed(columns).products(columns.T)
    for node, gram, product in zip(kinds, own.gram(columns[None])[0], weighed, strict=True):
        exact = columns[:count].T @ np.linalg.solve(node.covariance.frequency, columns[:count])
        exact += columns[count:].T @ (columns[count:] / node.covariance.shape[:, None])
        np.testing.assert_allclose(gram, exact, rtol=1e-8)
        np.testing.assert_allclose(product, exact, rtol=1e-8)


def test_a_prediction_that_failed_has_no_likelihood_and_spoils_no_other() -> None:
    found = _observations()
    residual = np.zeros((2, found.design.size))
    residual[0, 3] = np.nan
    log = Likelihood(nodes(found)).log(residual)
    assert log[0] == -np.inf
    assert np.isfinite(log[1])
