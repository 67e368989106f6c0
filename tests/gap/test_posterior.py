"""Evidence and moments of posteriors, against closed form and quadrature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp, ndtr

from shm.gap.hypotheses.contract import Hypothesis
from shm.gap.hypotheses.sampling import Sampling, approximate, sample
from shm.gap.hypotheses.target import Target
from shm.inference.sampler.density import find_peaks, laplace
from shm.inference.sampler.likelihood import Covariance, Likelihood, NoiseNode
from shm.models.effects import Parameter
from shm.values import ENOUGH_EFFECTIVE, FloatArray, IntArray

ALONE = Hypothesis()
SIZE = Parameter("size", "", 0.01, 1.0, 0.0, "", "logarithmic", signed=True)
Bend = Callable[[FloatArray], FloatArray]


def straight(z: FloatArray) -> FloatArray:
    return z


def mirrored(z: FloatArray) -> FloatArray:
    return np.asarray(z**2)


def of_either_sign(z: FloatArray) -> FloatArray:
    """Return values of a signed log-uniform parameter."""
    return 5 * SIZE.value(ndtr(z))


@dataclass
class Bent:
    """A problem that predicts `slopes` (data, d) @ z, the last z bent before it counts."""

    value: FloatArray
    slopes: FloatArray
    bend: Bend
    columns: tuple[int, ...]
    sds: tuple[float, ...] = (0.05, 0.1)

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        return np.array(self.columns, dtype=np.int64)

    def dimension(self, hypothesis: Hypothesis) -> int:
        return self.slopes.shape[1]

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        return np.column_stack([z[:, :-1], self.bend(z[:, -1])]) @ self.slopes.T

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        n = len(self.value)
        shapes = np.zeros(0), np.zeros((0, 0))
        return Likelihood(
            [
                NoiseNode(Covariance(sd**2 * np.eye(n), *shapes), -np.log(len(self.sds)), sd)
                for sd in self.sds
            ]
        )

    def by_quadrature(self) -> tuple[float, float, float]:
        """Return log evidence, and mean and standard deviation of the last z."""
        z = np.linspace(-6, 6, 6001)
        away = self.value - np.outer(self.bend(z), self.slopes[:, -1])
        own = self.slopes[:, :-1] @ self.slopes[:, :-1].T
        noise = [sd**2 * np.eye(len(self.value)) for sd in self.sds]
        log = logsumexp(
            [stats.multivariate_normal.logpdf(away, cov=c + own) for c in noise], axis=0
        )
        log = log - np.log(len(noise)) + stats.norm.logpdf(z)
        weight = np.exp(log - logsumexp(log))
        mean = float(weight @ z)
        log_evidence = float(logsumexp(log) + np.log(z[1] - z[0]))
        return log_evidence, mean, float(np.sqrt(weight @ (z - mean) ** 2))


def problem(bend: Bend, columns: tuple[int, ...], truth: float = 1.2, size: float = 0.1) -> Bent:
    """Make data of three parameters, the last one at `truth`."""
    rng = np.random.default_rng(4)
    slopes = np.array([0.3, 0.3, size]) * rng.standard_normal((8, 3))
    made = Bent(np.zeros(8), slopes, bend, columns)
    z = np.array([[0.5, -0.4, truth]])
    made.value = made.predict(ALONE, z)[0] + 0.05 * rng.standard_normal(8)
    return made


def starts(*last: float) -> FloatArray:
    z = np.zeros((len(last), 3))
    z[:, -1] = last
    return z


def sampled(of: Bent, enough: float = 400.0) -> Sampling:
    target = Target(of, ALONE)
    sampling = Sampling(target, find_peaks(target, starts(-1.5, 1.5)), np.random.default_rng(1))
    sampling.run(enough, 40)
    return sampling


def test_find_peaks_linear_exact() -> None:
    """One standard deviation: Laplace's method is exact where all is linear."""
    of = problem(straight, ())
    of.sds = (0.05,)
    (peak,) = find_peaks(Target(of, ALONE), starts(-1.5, 0.0, 1.5))
    precision = np.eye(3) + of.slopes.T @ of.slopes / 0.05**2
    best = np.linalg.solve(precision, of.slopes.T @ of.value / 0.05**2)
    sd = np.sqrt(np.diag(np.linalg.inv(precision)))
    assert np.abs((peak.z - best) / sd).max() < 0.3
    np.testing.assert_allclose(peak.covariance, np.linalg.inv(precision), rtol=1e-3, atol=1e-6)
    assert laplace([peak]) == pytest.approx(of.by_quadrature()[0], abs=0.03)


def test_find_peaks_mirrored() -> None:
    found = find_peaks(Target(problem(mirrored, (0, 1)), ALONE), starts(-2.0, -1.0, 0.9, 1.1, 2.0))
    assert sorted(np.sign(each.z[-1]) for each in found) == [-1, 1]
    assert found[0].log == pytest.approx(found[1].log, abs=0.05)


@pytest.mark.parametrize("columns", [(0, 1, 2), (0, 1), ()])
def test_sampling_linear_exact(columns: tuple[int, ...]) -> None:
    """All, some and none of the parameters integrated out in closed form."""
    of = problem(straight, columns)
    exact, mean, sd = of.by_quadrature()
    sampling = sampled(of)
    found = sampling.fit(4000)
    assert found.log_evidence == pytest.approx(exact, abs=1e-6 if len(columns) == 3 else 0.15)
    assert found.draws[:, -1].mean() == pytest.approx(mean, abs=0.15 * sd)
    assert found.draws[:, -1].std() == pytest.approx(sd, rel=0.15)


CASES = {
    "mirrored": (mirrored, 1.2),
    "signed": (of_either_sign, -0.5),
    "faint": (of_either_sign, 0.01),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("columns", [(0, 1), ()])
def test_sampling_nonlinear_by_quadrature(name: str, columns: tuple[int, ...]) -> None:
    """Two peaks; a signed log-uniform parameter, seen plainly and hardly."""
    of = problem(CASES[name][0], columns, CASES[name][1])
    exact, mean, sd = of.by_quadrature()
    found = sampled(of).fit(4000)
    assert found.log_evidence == pytest.approx(exact, abs=0.2)
    assert found.draws[:, -1].mean() == pytest.approx(mean, abs=0.2 * sd)
    assert found.draws[:, -1].std() == pytest.approx(sd, rel=0.2)


def test_sampling_effective_draws() -> None:
    """Evidences of several seeds scatter as their effective draws say."""
    of, found = problem(mirrored, (0, 1)), []
    target = Target(of, ALONE)
    peaks = find_peaks(target, starts(-1.5, 1.5))
    for seed in range(8):
        sampling = Sampling(target, peaks, np.random.default_rng(seed))
        assert sampling.effective == 0.0
        sampling.run(ENOUGH_EFFECTIVE, 40)
        assert sampling.effective >= ENOUGH_EFFECTIVE
        found.append(sampling.fit(50))
    assert np.std([each.log_evidence for each in found]) < 2 * found[0].log_evidence_sd
    assert max(each.effective for each in found) <= 50  # no more than there are draws


def test_sample_goes_on_by_chain_which_agrees() -> None:
    of = problem(mirrored, (0, 1), truth=0.6)
    exact, _, sd = of.by_quadrature()
    target, rng = Target(of, ALONE), np.random.default_rng(1)
    peaks = find_peaks(target, starts(-1.5, 1.5))
    one, found = (sample(target, peaks, n, rng, enough) for n, enough in ((4000, 400), (2000, 1e9)))
    assert (one.method, found.method) == ("sampled", "emcee")
    assert found.log_evidence == pytest.approx(exact, abs=0.2)
    sizes = [np.abs(each.draws[:, -1]).mean() for each in (one, found)]
    assert sizes[1] == pytest.approx(sizes[0], abs=0.15 * sd)


def test_approximate_peaks_by_weight() -> None:
    target = Target(problem(mirrored, (0, 1)), ALONE)
    peaks = find_peaks(target, starts(-1.0, 1.0))
    found = approximate(target, peaks, 2000, np.random.default_rng(1))
    assert found.method == "normal"
    assert found.log_evidence == pytest.approx(laplace(peaks))
    assert (found.draws[:, -1] > 0).mean() == pytest.approx(0.5, abs=0.06)
    assert found.log_fit == pytest.approx(
        float(target.likelihood.log(target.residual(peaks[0].z[None]))[0])
    )
