"""Sampled posteriors against brute force, where normal approximations are poor."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from shm.gap.contract import Hypothesis, Peak
from shm.gap.coordinates import Branch, Straight
from shm.gap.detectability import scan, truncate
from shm.gap.fit import baseline_fit, fitted
from shm.gap.importance_sampling import sampled
from shm.gap.noise import nodes
from shm.gap.problem import GapProblem
from shm.gap.proposal_distribution import Proposal
from shm.inference.mixture import normalised
from shm.models.effects import Variant
from shm.values import ENOUGH_EFFECTIVE, FloatArray
from tests.helpers.gap_campaigns import campaign, problem_of

_STEP = 1e-4


def _conditional_log_evidence(
    problem: GapProblem, hypothesis: Hypothesis, other: FloatArray, start: FloatArray
) -> FloatArray:
    """Log evidence (n,) at given effect parameters (n, p): linearised where the rest goes best."""
    n, linear = len(other), 5
    z = np.column_stack([np.repeat(start[None], n, axis=0), other])
    for _ in range(2):
        at = problem.predict(hypothesis, z)
        units = _STEP * np.eye(z.shape[1])[:linear]
        moved = [problem.predict(hypothesis, z + unit) for unit in units]
        slopes = np.stack([(each - at) / _STEP for each in moved], axis=2)
        shifted = problem.observations.value - at + np.einsum("nij,nj->ni", slopes, z[:, :linear])
        precision = 1 / (problem.observations.sd**2 + 3e-5**2)
        inner = np.einsum("nij,i,nik->njk", slopes, precision, slopes) + np.eye(linear)
        pull = np.einsum("nij,i,ni->nj", slopes, precision, shifted)
        z[:, :linear] = np.linalg.solve(inner, pull[..., None])[..., 0]
    log = [
        node.log_weight
        + _normal(shifted, node.covariance.frequency + slopes @ np.swapaxes(slopes, 1, 2))
        for node in nodes(problem.observations, problem.repeated)
    ]
    return np.asarray(logsumexp(log, axis=0))


def _normal(value: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log density (n,) of values (n, data) of N(0, covariance (n, data, data))."""
    square = (value * np.linalg.solve(covariance, value[..., None])[..., 0]).sum(axis=1)
    volume = np.linalg.slogdet(2 * np.pi * covariance)[1]
    return np.asarray(-(square + volume) / 2)


def _brute_force(
    problem: GapProblem, hypothesis: Hypothesis, points: tuple[int, ...], start: FloatArray
) -> float:
    """The mean evidence over midpoints of equal shares of the effect's prior."""
    shares = [(np.arange(count) + 0.5) / count for count in points]
    other = stats.norm.ppf(np.array(list(product(*shares))))
    log = _conditional_log_evidence(problem, hypothesis, other, start)
    return float(logsumexp(log) - np.log(len(log)))


@pytest.mark.trial
@pytest.mark.parametrize(
    ("effect", "values", "points"),
    [
        ("bending_stiffness", [0.02], (60,)),
        ("distributed_mass", [0.012], (60,)),
        ("point_mass", [0.6, 4.0], (16, 48)),
    ],
)
def test_the_evidence_of_an_effect_hardly_seen_is_that_of_brute_force(
    effect: str, values: list[float], points: tuple[int, ...]
) -> None:
    """Midpoint rule over the effect's parameters, the rest integrated in closed form."""
    problem = problem_of(campaign(((effect, Variant()),), values, seed=5))
    rng, hypothesis = np.random.default_rng(1), Hypothesis(((effect, Variant()),))
    before = baseline_fit(problem, rng)
    truncate(problem, scan(problem, before, hypothesis))
    fit = fitted(problem, hypothesis, rng)
    found = [sampled(problem, fit, np.random.default_rng(seed), 200) for seed in range(3)]
    exact = _brute_force(problem, hypothesis, points, fit.z[:5])
    each = np.array([one.log_evidence for one in found])
    assert each.mean() == pytest.approx(exact, abs=0.05 * (1 + len(points)))
    assert each.std(ddof=1) < 3 * found[0].log_evidence_sd


def test_sampled_draws_have_the_moments_of_brute_force() -> None:
    problem = problem_of(campaign((("distributed_mass", Variant()),), [0.012], seed=5))
    rng, hypothesis = np.random.default_rng(1), Hypothesis((("distributed_mass", Variant()),))
    fit = fitted(problem, hypothesis, rng)
    found = sampled(problem, fit, rng, 2000)
    other = stats.norm.ppf((np.arange(60) + 0.5) / 60)
    log = _conditional_log_evidence(problem, hypothesis, other[:, None], fit.z[:5])
    weight = np.exp(log - logsumexp(log))
    mean = weight @ other
    assert found.draws[:, 5].mean() == pytest.approx(mean, abs=0.25)
    assert found.draws[:, 5].std() == pytest.approx(np.sqrt(weight @ (other - mean) ** 2), rel=0.25)


def test_sampling_keeps_what_the_fit_found_and_says_how_sure_its_evidence_is() -> None:
    problem = problem_of(campaign((("point_mass", Variant()),), [12.0, 3.1]))
    rng, hypothesis = np.random.default_rng(1), Hypothesis((("point_mass", Variant()),))
    fit = fitted(problem, hypothesis, rng)
    found = sampled(problem, fit, rng, 300)
    assert found.method == "sampled"
    assert 0 < found.log_evidence_sd < 0.15
    assert found.draws.shape == (300, 7)
    assert found.log_evidence == pytest.approx(fit.log_evidence, abs=0.6)
    np.testing.assert_array_equal(found.z, fit.z)


def test_the_same_seed_gives_the_same_draws() -> None:
    problem = problem_of(campaign())
    hypothesis = Hypothesis((("bending_stiffness", Variant()),))
    fit = fitted(problem, hypothesis, np.random.default_rng(1))
    one, other = (sampled(problem, fit, np.random.default_rng(7), 50) for _ in range(2))
    np.testing.assert_array_equal(one.draws, other.draws)


def test_a_baseline_with_end_springs_is_sampled_in_its_springs() -> None:
    problem = problem_of(campaign(), "beam2")
    fit = baseline_fit(problem, np.random.default_rng(1))
    found = sampled(problem, fit, np.random.default_rng(2), 200)
    assert np.isfinite(found.log_evidence)
    assert found.log_evidence_sd < 0.5
    springs = problem.theta(Hypothesis(), found.draws)[:, 1:5]
    assert springs.min() > 6


def two_planes(seed: int = 0) -> GapProblem:
    """The ordinary field test: one test, frequencies of two planes, ends on springs."""
    return problem_of(campaign(tests=1, modes=5, seed=seed), "beam2")


def test_frequencies_of_two_planes_on_springs_have_enough_effective_draws_whatever_the_seed() -> (
    None
):
    """Where 1 to 20 of 1000 were effective, evidences were off by tens of nats, unremarked."""
    problem = two_planes()
    fit = baseline_fit(problem, np.random.default_rng(1))
    found = [sampled(problem, fit, np.random.default_rng(seed), 400) for seed in (1, 2)]
    assert all(each.effective >= ENOUGH_EFFECTIVE for each in found)
    evidences = [each.log_evidence for each in found]
    assert evidences[0] == pytest.approx(evidences[1], abs=1.0)
    tension = [problem.tension_n(Hypothesis(), each.draws) for each in found]
    half = np.ptp(np.quantile(tension[0], [0.05, 0.95])) / 2
    assert np.mean(tension[0]) == pytest.approx(np.mean(tension[1]), abs=0.3 * half)


def test_what_has_nothing_to_draw_is_integrated_out_and_every_draw_counts() -> None:
    """A clamped baseline is nearly linear: its sampled evidence has no error of its own."""
    problem = problem_of(campaign(tests=1))
    fit = baseline_fit(problem, np.random.default_rng(1))
    assert len(problem.coordinates(Hypothesis()).other) == 0
    found = sampled(problem, fit, np.random.default_rng(2), 300)
    assert found.effective >= ENOUGH_EFFECTIVE
    assert found.log_evidence_sd == pytest.approx(0.0, abs=1e-6)
    assert found.log_evidence == pytest.approx(fit.log_evidence, abs=0.3)


@dataclass(frozen=True)
class _Bent:
    """log of exp(-w0^2/2) exp(-(w1 - w0^2 + 1)^2 / (2 s^2)) / s: a banana of known mass."""

    s: float

    def log(self, w: FloatArray) -> FloatArray:
        away = (w[:, 1] - w[:, 0] ** 2 + 1) / self.s
        return np.asarray(-(w[:, 0] ** 2 + away**2) / 2 - np.log(2 * np.pi * self.s))


@pytest.mark.parametrize("s", [0.3, 0.1])
def test_refitting_follows_a_bent_posterior_until_most_draws_count(s: float) -> None:
    """From a normal about its top; the evidence of a density is 0."""
    rng, bent = np.random.default_rng(3), _Bent(s)
    signs = np.zeros(2)
    peak = Peak(signs, np.array([0.0, -1.0]), np.diag([1.0, s**2]), 0.0)
    proposal = Proposal.about([peak], [Branch(signs)], np.arange(2), Straight(()))
    shares = []
    for _ in range(6):
        points = proposal.draw(1500, rng)
        log_weight = bent.log(points.w) - proposal.log_density(points)
        weight = normalised(log_weight)
        shares.append(1 / np.sum(weight**2) / len(weight))
        proposal = proposal.refitted(points, log_weight, rng)
    points = proposal.draw(4000, rng)
    log_weight = bent.log(points.w) - proposal.log_density(points)
    assert shares[-1] > max(0.15, 1.5 * shares[0])
    assert logsumexp(log_weight) - np.log(4000) == pytest.approx(0.0, abs=0.08)


def test_refitting_keeps_to_narrow_peaks_far_apart() -> None:
    """Each 0.03 wide and 4 apart: what a cluster borrows from the whole is much wider."""
    rng, signs, sd = np.random.default_rng(4), np.zeros(2), 0.03
    tops = [np.array([-2.0, 0.5]), np.array([2.0, 0.5])]
    peaks = [Peak(signs, top, sd**2 * np.eye(2), 0.0) for top in tops]
    proposal = Proposal.about(peaks, [Branch(signs)], np.arange(2), Straight(()))
    for _ in range(4):
        points = proposal.draw(400, rng)
        log_target = logsumexp(
            [stats.multivariate_normal.logpdf(points.w, top, sd**2) for top in tops], axis=0
        )
        log_weight = log_target - proposal.log_density(points)
        proposal = proposal.refitted(points, log_weight, rng)
    points = proposal.draw(400, rng)
    log_target = logsumexp(
        [stats.multivariate_normal.logpdf(points.w, top, sd**2) for top in tops], axis=0
    )
    weight = normalised(log_target - proposal.log_density(points))
    assert 1 / np.sum(weight**2) > 0.25 * len(weight)
