"""Fits and their evidence: a linear toy with known evidence, and planted effects found again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.special import logsumexp

from shm.gap.contract import Fit, Hypothesis, Observations
from shm.gap.coordinates import Coordinates, Straight
from shm.gap.detectability import scan, superposed, truncate
from shm.gap.fit import baseline_fit, fitted
from shm.gap.importance_sampling import sampled
from shm.gap.likelihood import Likelihood
from shm.gap.noise import nodes
from shm.models.effects import Parameter, Variant
from shm.values import FloatArray, Scatter
from tests.gap import linear_toy as toy
from tests.helpers.gap_campaigns import campaign, problem_of
from tests.helpers.slow import few_of

BASELINE = Hypothesis()
CHANGE = Parameter("change", "", -1.0, 1.0, 0.0, "")
BASIC = (
    Parameter("theta_F", "", 0.5, 5.0, np.nan, ""),
    *(Parameter(name, "", -0.1, 0.1, 0.0, "") for name in "sdlm"),
)
DECK = Variant("deck end", ends=(0,))


@dataclass
class LinearProblem:
    """Predicts `slopes` (data, d) @ z; all priors of z are standard normal."""

    observations: Observations
    slopes: FloatArray
    fits: dict[Hypothesis, Fit] = field(default_factory=dict)

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        return z @ self.slopes.T

    def coordinates(self, hypothesis: Hypothesis) -> Coordinates:
        effect = (CHANGE,) * (self.slopes.shape[1] - len(BASIC))
        return Coordinates((*BASIC, *effect), 1, Scatter())

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        return Likelihood(nodes(self.observations))

    def straight(self, coordinates: Coordinates) -> Straight:
        return Straight(())

    @property
    def near(self) -> FloatArray:
        return np.zeros((1, self.slopes.shape[1]))

    def exact_log_evidence(self) -> float:
        return toy.log_evidence(nodes(self.observations), self.slopes, self.observations.value)


def _linear(seed: int, size: float = 3.0, known: bool = True) -> LinearProblem:
    """Five nearly linear parameters and one other, the last of the given size in sds."""
    rng = np.random.default_rng(seed)
    count = toy.design().frequencies
    slopes = np.zeros((toy.design().size, 6))
    slopes[:count] = 3e-3 * rng.standard_normal((count, 6))
    slopes[:count, 5] *= 0.02
    z = rng.standard_normal(6)
    z[5] = size
    observations = toy.observations(slopes @ z + toy.noise(rng))
    if not known:
        observations.sd[:count] = np.nan
    return LinearProblem(observations, slopes)


@pytest.mark.parametrize("known", [True, False])
def test_the_evidence_of_a_linear_problem_is_the_exact_one(known: bool) -> None:
    """y = J z + e, z ~ N(0, I), e ~ N(0, C_k) of weight w_k: p(y) = sum w_k N(y; 0, C_k + J J')."""
    for seed in range(3):
        problem = _linear(seed, known=known)
        fit = fitted(problem, BASELINE, np.random.default_rng(1))  # type: ignore[arg-type]
        exact = problem.exact_log_evidence()
        assert fit.log_evidence == pytest.approx(exact, abs=0.5 if known else 0.2)
        better = sampled(problem, fit, np.random.default_rng(2), 100)  # type: ignore[arg-type]
        assert better.log_evidence == pytest.approx(exact, abs=4 * better.log_evidence_sd + 0.02)
        assert better.log_evidence_sd < 0.15


def test_the_posterior_of_a_linear_problem_is_the_exact_one() -> None:
    problem = _linear(5)
    fit = fitted(problem, BASELINE, np.random.default_rng(1))  # type: ignore[arg-type]
    precision = np.diag(np.concatenate([np.zeros(0), 1 / problem.observations.sd**2]))
    count = toy.design().frequencies
    precision[:count, :count] = np.linalg.inv(fit.noise.frequency)
    covariance = np.linalg.inv(np.eye(6) + problem.slopes.T @ precision @ problem.slopes)
    mean = covariance @ problem.slopes.T @ precision @ problem.observations.value
    sd = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(fit.z, mean, atol=0.4 * sd.max())
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), sd, rtol=0.35)
    np.testing.assert_allclose(fit.slopes, problem.slopes, atol=1e-8)


def _recovered(
    effect: str, variant: Variant, values: Sequence[float], **options: float
) -> tuple[Fit, Fit, FloatArray]:
    """Baseline, fit of the planted effect, and its parameters at the fit's draws."""
    tests = campaign(((effect, variant),), values, **options)  # type: ignore[arg-type]
    problem, rng = problem_of(tests), np.random.default_rng(1)
    hypothesis = Hypothesis(((effect, variant),))
    before = baseline_fit(problem, rng)
    truncate(problem, scan(problem, before, hypothesis))
    after = fitted(problem, hypothesis, rng)
    after = sampled(problem, after, rng, 400)
    return before, after, problem.theta(hypothesis, after.draws)[:, 5:]


@pytest.mark.parametrize(
    ("effect", "variant", "values"),
    few_of(
        [
            ("point_mass", Variant(), [12.0, 3.1]),
            ("effective_length", DECK, [-0.3]),
            ("bending_stiffness", Variant(), [0.25]),
            ("rotational_end_flexibility", DECK, [6.8, 6.8]),
        ],
        2,
    ),
)
def test_a_planted_effect_is_found_again_within_its_interval(
    effect: str, variant: Variant, values: list[float]
) -> None:
    before, after, theta = _recovered(effect, variant, values)
    assert after.log_evidence > before.log_evidence + 5
    if effect == "point_mass":  # frequencies of a bar alike from both ends: a mirror image
        theta[:, 1] = np.minimum(theta[:, 1], 12 - theta[:, 1])
    # One end's truth is the posterior's quantile of 0.0020, by 4000 effective draws.
    assert (np.abs(theta.mean(axis=0) - values) < 3.5 * theta.std(axis=0)).all()


def test_both_mirror_images_of_a_point_mass_count_where_nothing_tells_them_apart() -> None:
    variant = Variant()
    tests = campaign((("point_mass", variant),), [12.0, 3.1], tests=1)
    # A second mass that nobody knows of sits at 3.6 m: the clamped one, not told.
    problem = problem_of([replace(test, added_mass=None) for test in tests])
    fit = fitted(problem, Hypothesis((("point_mass", variant),)), np.random.default_rng(1))
    x_m = problem.theta(fit.hypothesis, fit.draws)[:, 6]
    assert 0.2 < (x_m < 6).mean() < 0.8
    assert len(fit.peaks) >= 2
    assert fit.log_evidence == pytest.approx(logsumexp([p.log_evidence for p in fit.peaks]))


def test_draws_and_slopes_of_a_fit_belong_to_its_coordinates() -> None:
    problem = problem_of(campaign((("bending_stiffness", Variant()),), [-0.3]))
    hypothesis = Hypothesis((("bending_stiffness", Variant()),))
    fit = fitted(problem, hypothesis, np.random.default_rng(1))
    np.testing.assert_allclose(
        problem.predict(hypothesis, fit.z[None])[0], fit.predicted, atol=1e-9
    )
    step = 1e-4
    for column in range(6):
        moved = fit.z + step * np.eye(6)[column]
        slope = (problem.predict(hypothesis, moved[None])[0] - fit.predicted) / step
        np.testing.assert_allclose(fit.slopes[:, column], slope, atol=2e-4)
    assert problem.theta(hypothesis, fit.z[None])[0, 5] < 0
    away = (fit.draws - fit.z) / np.sqrt(np.diag(fit.covariance))
    assert np.abs(away.mean(axis=0)).max() < 0.4
    assert np.abs(away.std(axis=0) - 1).max() < 0.35


def test_without_a_gap_the_effects_evidence_is_below_the_baselines() -> None:
    problem, rng = problem_of(campaign(seed=3)), np.random.default_rng(1)
    before = baseline_fit(problem, rng)
    for effect in ("bending_stiffness", "point_mass", "distributed_mass"):
        hypothesis = Hypothesis(((effect, Variant()),))
        found = scan(problem, before, hypothesis)
        truncate(problem, found)
        assert 0 < found.smallest < 1
        assert sampled(problem, fitted(problem, hypothesis, rng), rng, 50).log_evidence < (
            before.log_evidence + 1.0
        )


def test_a_fit_of_part_of_the_data_predicts_the_rest() -> None:
    """Point mass planted: held-out orders are met by the fit of the others (chi-square)."""
    tests = campaign((("point_mass", Variant()),), [12.0, 3.1], tests=3)
    problem, rng = problem_of(tests), np.random.default_rng(1)
    kept = problem.design.frequency_order != 4
    hypothesis = Hypothesis((("point_mass", Variant()),))
    fit = fitted(problem.part(kept), hypothesis, rng)
    out = np.flatnonzero(~kept)
    miss = problem.observations.value[out] - problem.predict(hypothesis, fit.draws)[:, out]
    assert np.abs(miss.mean(axis=0)).max() < 2e-3
    plain = fitted(problem.part(kept), BASELINE, rng)
    before = problem.observations.value[out] - problem.predict(BASELINE, plain.z[None])[:, out]
    assert np.abs(miss.mean(axis=0)).max() < 0.5 * np.abs(before).max()


def test_a_scan_taken_over_to_another_fit_adds_the_shifts() -> None:
    pair = (("point_mass", Variant()), ("bending_stiffness", Variant()))
    problem = problem_of(campaign(pair, [12.0, 3.1, 0.2]))
    rng = np.random.default_rng(1)
    single, both = Hypothesis(pair[:1]), Hypothesis(pair)
    alone = scan(problem, baseline_fit(problem, rng), Hypothesis(pair[1:]))
    leader = fitted(problem, single, rng)
    found = superposed(problem, leader, alone, both)
    assert found.theta.shape == (len(alone.theta), 8)
    starts = found.starts(problem.coordinates(both), 2)
    after = fitted(problem, both, rng, starts)
    assert after.log_evidence > leader.log_evidence + 3
    assert problem.theta(both, after.z[None])[0, 7] == pytest.approx(0.2, abs=0.2)
