"""Compare evidences with quadrature, a conjugate Gaussian and two unequal modes."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import multivariate_normal

from shm.inference import UpdateOptions, update
from shm.inference.answer.updating import infer
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.inference.sampler.likelihood import Covariance, NoiseNode
from shm.models import THESIS, Model, build
from shm.values import FloatArray, Posterior
from tests.helpers.evidence_oracle import (
    ORACLE,
    TABLES,
    Resolution,
    beam1_log_evidence,
    beam2_log_evidence,
    modal_test,
)
from tests.helpers.hangers import HANGER_3

COARSE = Resolution(theta_step=1.4, nodes=24, springs=160, sigma_step_in_sd=1.2)


@pytest.mark.parametrize(
    ("table", "repeat"),
    [
        pytest.param(*each, marks=[] if each == ("1.1", 10) else [pytest.mark.trial])
        for each in product(TABLES, (1, 10))
    ],
)
def test_a_coarser_quadrature_agrees_with_the_stored_oracle(table: str, repeat: int) -> None:
    assert beam1_log_evidence(table, repeat, 500) == pytest.approx(
        ORACLE[table, "beam1", repeat], abs=2e-3
    )
    assert beam2_log_evidence(table, repeat, COARSE) == pytest.approx(
        ORACLE[table, "beam2", repeat], abs=5e-3
    )


@pytest.mark.parametrize(("table", "model", "repeat"), ORACLE)
def test_the_evidence_is_that_of_quadrature(table: str, model: str, repeat: int) -> None:
    tests = [modal_test(TABLES[table])] * repeat
    posterior = update(tests, build(model, HANGER_3, THESIS), UpdateOptions(1000, seed=11))
    error = posterior.log_evidence - ORACLE[table, model, repeat]
    assert abs(error) < 4 * posterior.log_evidence_sd
    assert posterior.log_evidence_sd < 0.08
    assert posterior.evaluations < 150_000


class KnownNoise(ThesisLikelihood):
    """Take normal errors of known standard deviation and no model error."""

    def frequency_nodes(self, step_in_sd: float) -> list[NoiseNode]:
        covariance = Covariance.of_frequencies(np.diag(self.identification_error**2))
        return [NoiseNode(covariance, 0.0, 0.0)]


def linear(dimension: int, slopes: FloatArray) -> Model:
    """Return a model whose predictions are linear in parameters of standard normal prior.

    `slopes` (2 modes, dimension). The uniform parameters are the priors' quantiles.
    """

    class Linear(Model):
        name = "linear"
        bounds = dict.fromkeys([f"a{i}" for i in range(dimension)], (0.0, 1.0))

        def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
            predicted = 1 + ndtri(theta.clip(1e-15, 1 - 1e-15)) @ slopes.T
            return predicted.reshape(len(theta), 2, modes)

    return Linear(HANGER_3)


@pytest.mark.parametrize("dimension", [2, 8, 20])
def test_the_evidence_of_a_conjugate_gaussian_is_exact(dimension: int) -> None:
    """Measure y = 1 of y = 1 + A z + e, z ~ N(0, I), e ~ N(0, s^2): y ~ N(1, A A' + s^2 I)."""
    count, noise = dimension + 4, 0.05
    slopes = np.random.default_rng(dimension).standard_normal((count, dimension)) / 4
    half = [1.0] * (count // 2)
    likelihood = KnownNoise([modal_test({"transverse": half, "longitudinal": half}, noise)])
    problem = Problem(linear(dimension, slopes), likelihood)
    covariance = slopes @ slopes.T + noise**2 * np.eye(count)
    exact = multivariate_normal(np.zeros(count), covariance).logpdf(np.zeros(count))
    found = infer(problem, UpdateOptions(1000), np.random.default_rng(1))
    assert found.method == "importance"
    assert found.log_evidence == pytest.approx(exact, abs=0.03)
    assert found.log_evidence_sd < 0.06
    posterior = np.linalg.inv(np.eye(dimension) + slopes.T @ slopes / noise**2)
    drawn = np.diag(np.cov(found.points.z.T))
    np.testing.assert_allclose(drawn, np.diag(posterior), rtol=0.25)


class TwoEnds(Model):
    """Give two springs that can nearly be exchanged: two modes of unequal mass.

    One plane sees a + b and a b, the other a tilt that tells the ends apart a little.
    """

    name = "two ends"
    bounds = {"a": (0.0, 1.0), "b": (0.0, 1.0)}  # noqa: RUF012

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        a, b = theta.T
        tilt = 1 + 0.01 * (a - b)
        alike = np.stack([1 + a + b, 1 + a * b], axis=1)
        return np.stack([alike, np.stack([tilt, tilt], axis=1)], axis=1)


def test_two_modes_of_unequal_mass_get_their_shares() -> None:
    noise, modes = 0.006, 2
    exact = TwoEnds(HANGER_3).frequencies_hz(np.array([[0.75, 0.3]]), modes)[0]
    frequencies = {"transverse": list(exact[0]), "longitudinal": list(exact[1])}
    likelihood = KnownNoise([modal_test(frequencies, noise)])
    model = TwoEnds(HANGER_3)
    axis = (np.arange(500) + 0.5) / 500
    theta = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    values = likelihood.marginal(likelihood.predict(model, theta))
    weights = np.exp(values - values.max())
    share = weights[theta[:, 0] > theta[:, 1]].sum() / weights.sum()
    assert 0.55 < share < 0.95
    found = infer(Problem(model, likelihood), UpdateOptions(2000), np.random.default_rng(3))
    z = found.points.z
    error = np.sqrt(share * (1 - share) / found.effective_sample_size)
    assert np.mean(z[:, 0] > z[:, 1]) == pytest.approx(share, abs=4 * error)
    assert found.log_evidence == pytest.approx(
        values.max() + np.log(weights.mean()), abs=4 * found.log_evidence_sd
    )


def run(seed: int) -> Posterior:
    options = UpdateOptions(200, seed)
    return update([modal_test(TABLES["1.1"])], build("beam2", HANGER_3, THESIS), options)


def test_the_same_seed_gives_the_same_posterior_whatever_the_executor() -> None:
    with ProcessPoolExecutor(1) as pool:
        elsewhere = pool.submit(run, 4).result()
    here = run(4)
    np.testing.assert_array_equal(elsewhere.samples, here.samples)
    assert elsewhere.log_evidence == here.log_evidence
