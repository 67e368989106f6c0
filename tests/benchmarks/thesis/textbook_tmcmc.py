"""Transitional Markov chain Monte Carlo as the thesis has it (4.2.2; Ching and Chen 2007).

A power b of the likelihood goes from 0 to 1, each step as far as a coefficient of variation of the
weights of 1 allows; sigma is a sampled parameter; a particle that is resampled k times makes a
chain of k random-walk Metropolis steps, whose covariance is 0.2^2 times that of the weighted
population; the evidence is the product of the mean weights. On hangers that evidence is biased by
-1 to -7 (`tests/benchmarks/evidence.py`), which is why `shm` samples in another way.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from shm.errors import UsageError
from shm.inference import Progress, UpdateOptions
from shm.inference.answer.other_answers import Outcome
from shm.inference.answer.outcome import assembled
from shm.inference.options import silent
from shm.inference.problem.hanger_problem import Problem
from shm.inference.sampler.density import Points
from shm.inference.sampler.mixture import Normal, Rows, Weighted, normalised
from shm.models import THESIS, Model
from shm.values import BoolArray, FloatArray, ModalTest, Posterior

# Ching and Chen (2007), thesis 4.3: scale of the random walk, variation of a stage's weights.
SCALE = 0.2
TARGET_VARIATION = 1.0


@dataclass(frozen=True, eq=False)
class _Particles(Rows):
    """`theta` (n, d + 1) with sigma last, `predicted` (n, measurements), log likelihood (n,)."""

    theta: FloatArray
    predicted: FloatArray
    log_likelihood: FloatArray

    def where(self, chosen: BoolArray, other: _Particles) -> _Particles:
        """Return these where `chosen` (n,), elsewhere the `other` ones."""
        both = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Particles(
            *(np.where(chosen if a.ndim == 1 else chosen[:, None], a, b) for a, b in both)
        )


def update_textbook(
    tests: Sequence[ModalTest],
    model: Model,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
) -> Posterior:
    """Return the posterior of `model` given `tests`, by the thesis's own sampler.

    Raises UsageError for other priors than the thesis's: the sampler draws the model error
    uniformly and has no part in the noise of the field.
    """
    if model.priors != THESIS:
        raise UsageError(
            "the textbook's sampler draws the model error uniformly, as the thesis does.",
            remedy="Take the priors of the thesis.",
        )
    options = options or UpdateOptions()
    problem = Problem.of(tests, model, progress)
    started = time.perf_counter()
    outcome = sample_textbook(problem, options.samples, np.random.default_rng(options.seed))
    return assembled(problem, outcome, tests, options, started)


def sample_textbook(problem: Problem, particles: int, rng: np.random.Generator) -> Outcome:
    """Return the posterior's draws and the evidence."""
    lower, upper = _box(problem)
    population = _run(problem, lower + (upper - lower) * rng.random((particles, len(lower))))
    power, log_evidence, variance = 0.0, 0.0, 0.0
    while power < 1:
        step = _power_step(population.log_likelihood, 1 - power)
        log_weights = step * population.log_likelihood
        weights = normalised(log_weights)
        power = power + step if step < 1 - power else 1.0
        log_evidence += float(np.logaddexp.reduce(log_weights) - np.log(particles))
        variance += float((weights * particles).var() / particles)
        population = _moved(problem, population, weights, power, rng)
    return _outcome(population, log_evidence, np.sqrt(variance), rng)


def _box(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """The uniform prior's bounds (d + 1,), sigma last."""
    return np.append(problem.prior.lower, 0.0), np.append(problem.prior.upper, 1.0)


def _run(problem: Problem, theta: FloatArray) -> _Particles:
    predicted = problem.run(theta[:, :-1])
    return _Particles(theta, predicted, problem.measured.joint(predicted, theta[:, -1]))


def _power_step(log_likelihood: FloatArray, most: float) -> float:
    """The largest step of the power whose weights keep the target variation."""

    def too_far(step: float) -> bool:
        weights = normalised(step * log_likelihood)
        return bool(weights.std() > TARGET_VARIATION * weights.mean())

    if not too_far(most):
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if too_far(middle) else (middle, high)
    return high


def _moved(
    problem: Problem,
    population: _Particles,
    weights: FloatArray,
    power: float,
    rng: np.random.Generator,
) -> _Particles:
    """The next population: each chosen particle leads a chain as long as it was chosen often."""
    covariance = np.cov(population.theta.T, aweights=weights)
    walk = Normal(np.zeros(len(covariance)), SCALE**2 * covariance)
    factor = np.asarray(walk.factor, dtype=float)
    lengths = rng.multinomial(len(weights), weights)
    chains, visited = population.take(np.flatnonzero(lengths)), []
    lengths = lengths[lengths > 0]
    while len(lengths):
        chains = _stepped(problem, chains, factor, power, rng)
        visited.append(chains)
        lengths = lengths - 1
        chains, lengths = chains.take(np.flatnonzero(lengths)), lengths[lengths > 0]
    return reduce(_Particles.joined, visited)


def _stepped(
    problem: Problem, chains: _Particles, factor: FloatArray, power: float, rng: np.random.Generator
) -> _Particles:
    """One random-walk Metropolis step of all chains; what leaves the prior is rejected."""
    lower, upper = _box(problem)
    theta = chains.theta + rng.standard_normal(chains.theta.shape) @ factor.T
    inside: BoolArray = np.all((theta > lower) & (theta < upper), axis=1)
    proposed = _run(problem, np.where(inside[:, None], theta, chains.theta))
    gain = power * (proposed.log_likelihood - chains.log_likelihood)
    accepted = inside & (np.log(rng.random(len(theta))) < gain)
    return proposed.where(accepted, chains)


def _outcome(
    population: _Particles, log_evidence: float, log_evidence_sd: float, rng: np.random.Generator
) -> Outcome:
    """The last population in random order; the distinct particles count as effective."""
    n = len(population.theta)
    population = population.take(rng.permutation(n))
    equal = Weighted(Points(population.theta, population.predicted), np.zeros(n))
    distinct = float(len(np.unique(population.theta, axis=0)))
    return Outcome(
        population.theta,
        population.predicted,
        log_evidence,
        log_evidence_sd,
        distinct,
        equal.r_hat,
        "textbook",
    )
