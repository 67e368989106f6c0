"""Check weights, their tails and emcee's chains, on which an answer rests."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from shm.inference import UpdateOptions, update
from shm.inference.options import EMCEE, silent
from shm.inference.problem.hanger_problem import Problem
from shm.inference.sampler import sampling
from shm.inference.sampler.chain import run_chain
from shm.inference.sampler.density import Points
from shm.inference.sampler.mixture import Weighted
from shm.inference.sampler.valley import Draws
from shm.models import THESIS, build
from shm.values import FloatArray, Posterior
from tests.helpers.evidence_oracle import TABLES, modal_test
from tests.helpers.hangers import HANGER_3

TESTS = [modal_test(TABLES["1.1"])]
BEAM1 = build("beam1", HANGER_3, THESIS)


def weighted(log_weights: FloatArray, seed: int = 1) -> Weighted[Draws]:
    z = np.random.default_rng(seed).standard_normal((len(log_weights), 1))
    return Weighted(Draws(z, z, z, z), log_weights)


def test_figures_of_weights_are_those_of_their_definition() -> None:
    log_weights = np.log(np.array([1.0, 1.0, 2.0, 4.0] * 500))
    found = weighted(log_weights)
    assert found.effective_sample_size == pytest.approx(2000 * 8**2 / (4 * 22))
    assert found.log_evidence == pytest.approx(np.log(2))
    relative = np.std([1, 1, 2, 4]) / 2 / np.sqrt(2000)
    assert relative <= found.log_evidence_sd <= 1.3 * relative
    assert found.r_hat == pytest.approx(1, abs=0.01)
    # Systematic resampling repeats a draw by its weight, to within one.
    rows = found.resampled(4000, np.random.default_rng(1)).z
    heavy = np.isin(rows, found.points.z[3::4]).mean()
    assert heavy == pytest.approx(0.5, abs=1e-3)
    apart = found.spread(160, np.random.default_rng(1))
    assert len(np.unique(apart)) == 160


# ------------------------------------------------ emcee


@pytest.fixture(scope="module")
def by_importance() -> Posterior:
    return update(TESTS, BEAM1, UpdateOptions(1000, seed=3))


@pytest.fixture(scope="module")
def by_emcee() -> Posterior:
    return update(TESTS, BEAM1, UpdateOptions(1000, seed=4, sampler=EMCEE))


def test_emcee_agrees_with_importance_sampling(
    by_importance: Posterior, by_emcee: Posterior
) -> None:
    assert (by_importance.method, by_emcee.method) == ("importance", "emcee")
    assert by_emcee.effective_sample_size > 200
    for name in ("theta_F", "theta_L", "sigma"):
        one, other = by_importance.parameter(name), by_emcee.parameter(name)
        sizes = by_importance.effective_sample_size, by_emcee.effective_sample_size
        error = np.hypot(one.std() / np.sqrt(sizes[0]), other.std() / np.sqrt(sizes[1]))
        assert one.mean() == pytest.approx(other.mean(), abs=3 * error), name
    error = 4 * np.hypot(by_importance.log_evidence_sd, by_emcee.log_evidence_sd)
    assert by_importance.log_evidence == pytest.approx(by_emcee.log_evidence, abs=error)


def test_emcee_continues_where_too_few_draws_are_effective(
    monkeypatch: pytest.MonkeyPatch, by_importance: Posterior
) -> None:
    """Give one draw nearly all the weight, as where a proposal misses a ridge."""

    def poor(density, proposal, enough, rng):  # type: ignore[no-untyped-def]
        draws = proposal.draw(density, 500, rng)
        log_weights = density.log_posterior(draws)
        log_weights[log_weights.argmax()] += 30
        return Weighted(draws, log_weights)

    monkeypatch.setattr(sampling, "weigh", poor)
    found = update(TESTS, BEAM1, UpdateOptions(1000, seed=5))
    assert found.method == "emcee"
    error = 4 * found.tension_n.std() / np.sqrt(found.effective_sample_size)
    assert found.tension_n.mean() == pytest.approx(by_importance.tension_n.mean(), abs=error)


class NormalProblem:
    """Give a normal target of known covariance."""

    dimension = 3
    covariance = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 0.01]])

    def evaluate(self, z: FloatArray) -> Points:
        return Points(z, z)

    def log_posterior(self, points: Points) -> FloatArray:
        return np.asarray(multivariate_normal(np.zeros(3), self.covariance).logpdf(points.z))


def test_frozen_walkers_are_left_out() -> None:
    """Start half of them at the highest density, at places that no move meets again."""

    class Frozen(NormalProblem):
        places: FloatArray | None = None

        def log_posterior(self, points: Points) -> FloatArray:
            z = points.z[:, 0]
            if self.places is None:
                self.places = z[z > 20]
            inside = np.where(np.abs(z) < 20, super().log_posterior(points), -np.inf)
            return np.where(np.isin(z, self.places), 50.0, inside)

    rng = np.random.default_rng(2)
    start = rng.multivariate_normal(np.zeros(3), NormalProblem.covariance, 100)
    start[::2, 0] += 30
    points, size, _ = run_chain(Frozen(), start, rng)  # type: ignore[arg-type]
    assert np.abs(points).max() < 20
    assert size > 100
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=5 / np.sqrt(size))


# ------------------------------------------------ predictions that are no number


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_prediction_that_is_no_number_weighs_nothing(bad: float) -> None:
    problem = Problem.of(TESTS, BEAM1, silent)
    z = problem.coordinates.draw_prior(10, np.random.default_rng(1))
    points = problem.evaluate(z)
    points.predicted[3] = bad
    log = problem.log_posterior(points)
    assert log[3] == -np.inf
    assert np.isfinite(np.delete(log, 3)).all()
    points.predicted[:] = bad
    assert np.all(problem.log_posterior(points) == -np.inf)


class Broken(type(BEAM1)):  # type: ignore[misc]
    """Give no frequencies for a tenth of the parameter sets."""

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        found = super().frequencies_hz(theta, modes)
        gap = (theta[:, 1] * 1e4 % 10) < 1
        return np.where(gap[:, None, None], np.nan, found)


def test_an_update_survives_parameter_sets_without_frequencies(by_importance: Posterior) -> None:
    found = update(TESTS, Broken(HANGER_3), UpdateOptions(500, seed=1))
    assert np.isfinite(found.samples).all()
    assert all(np.isfinite(row.mean_hz) for row in found.predicted)
    assert found.log_evidence == pytest.approx(by_importance.log_evidence + np.log(0.9), abs=0.2)
    assert found.tension_n.mean() == pytest.approx(by_importance.tension_n.mean(), rel=0.02)
