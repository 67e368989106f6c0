"""Unknown errors integrated over nodes, and the likelihood that they make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.special import logsumexp

from shm.assumptions import DEFAULTS
from shm.gap.hypotheses.contract import Observations
from shm.gap.hypotheses.noise import (
    drawn_together,
    flexible_nodes,
    nodes,
)
from shm.gap.hypotheses.repeated_errors import Repeated
from shm.inference.sampler.likelihood import Covariance, Likelihood
from shm.values import FloatArray
from tests.gap import linear_toy as toy

SD_LOWER, SD_UPPER = DEFAULTS.unstated_frequency_sd.bounds


def _observations(sd: float | None = 2e-4) -> Observations:
    """The toy's, with another standard deviation of its frequencies, or with none."""
    found = toy.observations(np.zeros(toy.design().size))
    frequency = np.full(found.design.frequencies, np.nan if sd is None else sd)
    return replace(found, sd=np.concatenate([frequency, found.sd[found.design.frequencies :]]))


def _shape(covariance: Covariance) -> FloatArray:
    loads = covariance.shape_loads
    return np.asarray(np.diag(covariance.shape) + loads @ loads.T)


def _repeated(found: Observations) -> Repeated:
    """Some errors that repeat: two of the frequencies, five of the shapes."""
    rng = np.random.default_rng(8)
    return Repeated(
        1e-4 * rng.standard_normal((found.design.frequencies, 2)),
        np.zeros((found.design.frequencies, 0)),
        np.zeros((found.design.frequencies, 0)),
        0.01 * rng.standard_normal((len(found.design.shape_mode), 5)),
    )


@pytest.mark.parametrize("sd", [2e-4, None])
def test_the_weights_add_to_one(sd: float | None) -> None:
    assert logsumexp([node.log_weight for node in nodes(_observations(sd))]) == pytest.approx(0)


def test_peaks_that_overlap_may_err_together() -> None:
    """The same error in both planes is likelier, and weighs less, than two of one's own."""
    found = _observations()
    design = found.design
    apart = replace(found, value=found.value + 0.0)
    apart.value[: design.frequencies] += 0.01 * design.frequency_plane
    assert len(nodes(found)) == 2 * len(nodes(apart))
    residual = np.random.default_rng(3).standard_normal(design.frequencies)
    alike = np.where(design.frequency_plane == 0, residual, np.roll(residual, toy.MODES))
    log_odds = []
    for error in (residual, alike):
        data = np.zeros((1, design.size))
        data[0, : design.frequencies] = 2e-4 * error
        log_odds.append(Likelihood(nodes(found)).log(data) - Likelihood(nodes(apart)).log(data))
    assert log_odds[1] > 1.0 > log_odds[0]
    together = Likelihood(nodes(found)).weighed(toy.tension()).products(toy.tension().T)
    assert together.min() < 0.8 * together.max()


def test_the_model_error_and_the_factor_are_integrated_right() -> None:
    """Closed form for one mode in one test: the double integral by quadrature."""
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

    log_factor = np.linspace(-2.0, 2.0, 401)
    spread, freedom = DEFAULTS.stated_sd_log_sd.value, DEFAULTS.stated_sd_freedom.value
    of_factor = stats.t.pdf(log_factor / spread, freedom) / spread
    log_tau = np.linspace(*np.log(DEFAULTS.model_error.bounds), 400)
    of_tau = 1 / np.ptp(log_tau)
    for residual in (0.0, 1e-4, 3e-4, 2e-3):
        sd = np.hypot(1e-4 * np.exp(log_factor[:, None]), np.exp(log_tau))
        values = of_tau * of_factor[:, None] * stats.norm.pdf(residual, scale=sd)
        exact = integrate.trapezoid(integrate.trapezoid(values, log_tau), log_factor)
        assert found.log(np.array([[residual]]))[0] == pytest.approx(np.log(exact), abs=0.12)


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
        + np.sum(stats.norm.logpdf(0, scale=np.sqrt(own.nodes[0].covariance.shape)))
    )
    assert own.log(residual[None])[0] == pytest.approx(exact, abs=0.05)


def test_where_some_standard_deviations_are_unknown_both_unknowns_are_integrated() -> None:
    found = _observations()
    found.sd[:5] = np.nan
    kinds = nodes(found)
    assert logsumexp([node.log_weight for node in kinds]) == pytest.approx(0)
    factors = np.array(
        [np.sqrt(node.covariance.frequency[8, 8] - node.model_error**2) / 2e-4 for node in kinds]
    )
    assert len(np.unique(factors.round(6))) == 5
    assert len({float(node.covariance.frequency[0, 0]) for node in kinds}) == len(kinds) / 5


@pytest.mark.parametrize("shuffled", [False, True])
def test_the_likelihood_and_its_products_are_those_of_the_full_covariance(shuffled: bool) -> None:
    found, rng = _observations(), np.random.default_rng(2)
    kinds, count = nodes(found, _repeated(found))[::4], found.design.frequencies
    order = rng.permutation(count) if shuffled else np.arange(count)
    covariances = [
        replace(each.covariance, frequency=each.covariance.frequency[np.ix_(order, order)])
        for each in kinds
    ]
    own = Likelihood(
        [replace(node, covariance=each) for node, each in zip(kinds, covariances, strict=True)]
    )
    residual = found.sd * rng.standard_normal((3, found.design.size))
    exact = [
        node.log_weight
        + stats.multivariate_normal.logpdf(residual[:, :count], None, each.frequency)
        + stats.multivariate_normal.logpdf(residual[:, count:], None, _shape(each))
        for node, each in zip(kinds, covariances, strict=True)
    ]
    np.testing.assert_allclose(own.log(residual), logsumexp(exact, axis=0), rtol=1e-10)
    columns = rng.standard_normal((found.design.size, 3))
    weighed, squares = own.weighed(columns).products(columns.T), own.squares(columns.T).T
    for k, each in enumerate(covariances):
        product = columns[:count].T @ np.linalg.solve(each.frequency, columns[:count])
        product += columns[count:].T @ np.linalg.solve(_shape(each), columns[count:])
        np.testing.assert_allclose(own.gram(columns[None])[0, k], product, rtol=1e-8)
        np.testing.assert_allclose(weighed[k], product, rtol=1e-8)
        np.testing.assert_allclose(squares[k], np.diag(product), rtol=1e-8)


def test_the_scatter_of_shapes_between_tests_says_how_wrong_their_sds_are() -> None:
    found = toy.observations(np.zeros(toy.design().size))
    count = found.design.frequencies
    shapes = _drawn_shapes(found, 1.3 * toy.SHAPE_SD, np.random.default_rng(5))
    value = np.concatenate([np.zeros(count), shapes])
    (factor,) = {
        round(float(np.sqrt(node.covariance.shape[0]) / toy.SHAPE_SD), 6)
        for node in nodes(replace(found, value=value))
    }
    assert factor == pytest.approx(1.3, rel=0.07)


def test_one_test_leaves_the_sds_of_shapes_open() -> None:
    own = toy.design()
    first = own.frequency_test[own.shape_mode] == 0
    one = replace(
        own,
        shape_mode=own.shape_mode[first],
        shape_place=own.shape_place[first],
        shape_component=own.shape_component[first],
    )
    found = toy.observations(np.zeros(one.size), one)
    factors = {float(node.covariance.shape[0]) for node in nodes(found)}
    assert len(factors) == 3
    assert min(factors) < toy.SHAPE_SD**2 < max(factors)


def _drawn_shapes(found: Observations, sd: float, rng: np.random.Generator) -> FloatArray:
    """Unit shapes, alike in all tests, measured with errors of `sd` and scaled again."""
    design = found.design
    components = 2 * toy.PLACES
    modes = design.frequencies // toy.TESTS
    true = rng.standard_normal((1, modes, components))
    true /= np.linalg.norm(true, axis=2, keepdims=True)
    measured = true + sd * rng.standard_normal((toy.TESTS, modes, components))
    measured /= np.linalg.norm(measured, axis=2, keepdims=True)
    return np.asarray(measured.ravel())


def test_sds_that_differ_by_chance_are_drawn_together() -> None:
    """Twenty degrees of freedom a test: what is drawn is nearer to the truth by far."""
    found, rng = _observations(), np.random.default_rng(6)
    stated = found.sd * np.sqrt(rng.chisquare(20, len(found.sd)) / 20)
    shapes = np.repeat(stated[: found.design.frequencies], 2 * toy.PLACES) * toy.SHAPE_SD / 2e-4
    stated[found.design.frequencies :] = shapes
    drawn = drawn_together(replace(found, sd=stated))
    assert np.std(np.log(drawn / found.sd)) < 0.75 * np.std(np.log(stated / found.sd))


def test_sds_that_differ_from_test_to_test_are_kept() -> None:
    found = _observations()
    stated = found.sd.copy()
    frequencies = stated[: found.design.frequencies]
    frequencies *= np.array([0.3, 1.0, 3.0])[found.design.frequency_test]
    drawn = drawn_together(replace(found, sd=stated))
    np.testing.assert_allclose(drawn, stated, rtol=0.06)


SEEDS = pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.trial) for seed in range(1, 5))]
)


def test_something_unknown_may_grow_with_the_temperature() -> None:
    plain = toy.observations(np.zeros(toy.design().size))
    varied = toy.observations(plain.value, toy.design((-15.0, 0.0, 15.0)))
    assert len(flexible_nodes(varied)) > len(flexible_nodes(plain))
    plain.sd[: plain.design.frequencies] = np.nan
    weights = np.exp([node.log_weight for node in flexible_nodes(plain)])
    assert weights.sum() == pytest.approx(1.0)


@SEEDS
@pytest.mark.parametrize(("size", "least"), [(0.0, 1.0), (2e-3, 3.0), (2e-2, 3.0)])
def test_something_unknown_loses_to_what_is_right(seed: int, size: float, least: float) -> None:
    """To the baseline without a gap, to the right effect with one."""
    value = toy.noise(np.random.default_rng(seed)) + toy.stiffening(size)
    errors, right = toy.observations(value), toy.tension()
    if size:
        right = np.column_stack([right, toy.stiffening(0.05)])
    known = toy.log_evidence(nodes(errors), right, value)
    assert known > toy.log_evidence(flexible_nodes(errors), toy.tension(), value) + least


@SEEDS
@pytest.mark.parametrize("size", [8e-3, 4e-2])
def test_it_beats_a_wrong_effect_that_fits_half_of_the_gap(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    design = toy.design()
    odd = np.where(design.frequency_order % 2 == 1, 1.0, 0.3)
    value = toy.noise(rng)
    value[: design.frequencies] += size * (design.frequency_order / toy.MODES) ** 2 * odd
    errors = toy.observations(value)
    wrong = np.column_stack([toy.tension(), toy.stiffening(0.05)])
    half = toy.log_evidence(nodes(errors), wrong, value)
    remainder = flexible_nodes(errors)
    unknown = [toy.log_evidence(remainder, slopes, value) for slopes in (toy.tension(), wrong)]
    assert max(unknown) > half + 2


def test_shapes_that_are_off_everywhere_are_something_unknown() -> None:
    value = toy.noise(np.random.default_rng(3))
    first = toy.design().frequencies
    value[first:] += np.random.default_rng(4).normal(0.0, 0.02, len(value) - first)
    errors = toy.observations(value)
    plain = toy.log_evidence(nodes(errors), toy.tension(), value)
    assert toy.log_evidence(flexible_nodes(errors), toy.tension(), value) > plain + 10
