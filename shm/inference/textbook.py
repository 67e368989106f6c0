"""TMCMC as Ching and Chen (2007, J. Eng. Mech. 133(7), 816-832) and the thesis (4.3) have it.

The likelihood is raised to a power b that goes from 0 to 1, each step as far as a coefficient of
variation of the weights of 1 allows; the model error sigma is a sampled parameter; a particle that
is resampled k times makes a chain of k random-walk Metropolis steps, whose covariance is 0.2^2
times that of the weighted population; the evidence is the product of the mean weights.

It is here for fidelity. On hangers its evidence is wrong, for sigma collapses at some power: a
phase transition that the population does not follow.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from shm.inference.importance import Weighted
from shm.inference.mixture import Normal
from shm.inference.other_answers import Outcome
from shm.inference.problem import Points, Problem
from shm.inference.tmcmc import normalised
from shm.values import BoolArray, FloatArray, IntArray

# Ching and Chen (2007), thesis 4.3: scale of the random walk, variation of a stage's weights.
_SCALE = 0.2
_TARGET_VARIATION = 1.0


class BiasedEvidenceWarning(UserWarning):
    """The method's evidence is known to be biased on hangers."""


@dataclass(frozen=True, eq=False)
class _Particles:
    """`theta` (n, d + 1) with sigma last, `predicted` (n, measurements), log likelihood (n,)."""

    theta: FloatArray
    predicted: FloatArray
    log_likelihood: FloatArray

    def take(self, index: IntArray) -> _Particles:
        return _Particles(self.theta[index], self.predicted[index], self.log_likelihood[index])


def textbook(problem: Problem, particles: int, rng: np.random.Generator) -> Outcome:
    """The posterior's draws and evidence by the textbook; warns with BiasedEvidenceWarning."""
    warnings.warn(
        "textbook TMCMC: a bias of -1 to -7 in log evidence was measured on hangers; use the "
        "default method for evidences and model selection.",
        BiasedEvidenceWarning,
        stacklevel=3,
    )
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
    return _Particles(theta, predicted, problem.likelihood.joint(predicted, theta[:, -1]))


def _power_step(log_likelihood: FloatArray, most: float) -> float:
    """The largest step of the power whose weights keep the target variation."""

    def too_far(step: float) -> bool:
        weights = normalised(step * log_likelihood)
        return bool(weights.std() > _TARGET_VARIATION * weights.mean())

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
    walk = Normal(np.zeros(len(covariance)), _SCALE**2 * covariance)
    factor = np.asarray(walk.factor, dtype=float)
    lengths = rng.multinomial(len(weights), weights)
    chains, visited = population.take(np.flatnonzero(lengths)), []
    lengths = lengths[lengths > 0]
    while len(lengths):
        chains = _stepped(problem, chains, factor, power, rng)
        visited.append(chains)
        lengths = lengths - 1
        chains, lengths = chains.take(np.flatnonzero(lengths)), lengths[lengths > 0]
    return _joined(visited)


def _stepped(
    problem: Problem,
    chains: _Particles,
    factor: FloatArray,
    power: float,
    rng: np.random.Generator,
) -> _Particles:
    """One random-walk Metropolis step of all chains; what leaves the prior is rejected."""
    lower, upper = _box(problem)
    theta = chains.theta + rng.standard_normal(chains.theta.shape) @ factor.T
    inside: BoolArray = np.all((theta > lower) & (theta < upper), axis=1)
    proposed = _run(problem, np.where(inside[:, None], theta, chains.theta))
    gain = power * (proposed.log_likelihood - chains.log_likelihood)
    accepted = inside & (np.log(rng.random(len(theta))) < gain)
    both = _joined([chains, proposed])
    return both.take(np.arange(len(theta)) + len(theta) * accepted)


def _joined(parts: list[_Particles]) -> _Particles:
    return _Particles(
        np.vstack([part.theta for part in parts]),
        np.vstack([part.predicted for part in parts]),
        np.concatenate([part.log_likelihood for part in parts]),
    )


def _outcome(
    population: _Particles, log_evidence: float, log_evidence_sd: float, rng: np.random.Generator
) -> Outcome:
    """The last population in random order; the distinct particles count as effective."""
    n = len(population.theta)
    population = population.take(rng.permutation(n))
    equal = Weighted(Points(population.theta, population.predicted), np.zeros(n), n)
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
