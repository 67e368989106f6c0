"""Transitional Markov chain Monte Carlo (Ching and Chen 2007, J. Eng. Mech. 133(7), 816-832).

A population goes from the prior to the posterior in stages; each next stage is as far away as a
coefficient of variation of the weights of 1 allows; the population is resampled and moved.

Two things differ from the textbook. The likelihood is not raised to a power: on this problem that
path meets a phase transition (the model error sigma collapses at some power) and its evidence is
biased by 1 to 4. Instead a fictitious error `floor` is added to the variance of the likelihood and
lowered from infinity (the prior) to 0 (the posterior). And the moves are t-preconditioned
Crank-Nicolson steps (Grumitt, Karamanis and Seljak 2023), many a stage, which hold the prior and
the heavy tails that a random walk scaled on the covariance does not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shm.update.problem import Points, Problem
from shm.values import FloatArray, IntArray

_TARGET_VARIATION = 1.0
_TARGET_ACCEPTANCE = 0.3
_MOVES = 8
_DEGREES_OF_FREEDOM = 5.0
_SMALLEST_FLOOR = 1e-9
_LARGEST_FLOOR = 1e3


def sample(
    problem: Problem,
    particles: int,
    rng: np.random.Generator,
    on_stage: Callable[[float], None] = lambda floor: None,
) -> Points:
    """`particles` points of the posterior of `problem`; `on_stage` hears each stage's floor."""
    points = problem.evaluate(problem.draw_prior(particles, rng))
    floor, current, step = np.inf, np.zeros(particles), 0.6
    while floor > 0:
        floor = next_floor(problem, points, current, floor)
        on_stage(floor)
        weights = normalised(problem.log_likelihood(points, floor) - current)
        centre = Normal.of(points.z, weights)
        points = points.take(systematic(weights, particles, rng))
        points, step = move(problem, points, floor, centre, step, _MOVES, rng)
        current = problem.log_likelihood(points, floor)
    return points


def next_floor(problem: Problem, points: Points, current: FloatArray, floor: float) -> float:
    """The lowest floor whose weights keep the target variation; 0 once that is in reach."""

    def variation(candidate: float) -> float:
        weights = normalised(problem.log_likelihood(points, candidate) - current)
        return float(weights.std() / weights.mean())

    if variation(0.0) <= _TARGET_VARIATION:
        return 0.0
    low, high = np.log(_SMALLEST_FLOOR), np.log(min(floor, _LARGEST_FLOOR))
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (
            (low, middle) if variation(np.exp(middle)) < _TARGET_VARIATION else (middle, high)
        )
    return float(np.exp(high))


def normalised(log_weights: FloatArray) -> FloatArray:
    """Weights (n,) that add to 1."""
    weights = np.exp(log_weights - log_weights.max())
    return np.asarray(weights / weights.sum())


def systematic(weights: FloatArray, n: int, rng: np.random.Generator) -> IntArray:
    """Indices (n,) drawn with `weights` by systematic resampling."""
    positions = (np.arange(n) + rng.random()) / n
    return np.searchsorted(np.cumsum(weights), positions).clip(0, len(weights) - 1).astype(int)


class Normal:
    """Centre and Cholesky factor of a weighted population, to whiten the moves."""

    def __init__(self, mean: FloatArray, covariance: FloatArray):
        self.mean = mean
        self.factor = np.linalg.cholesky(covariance)
        self.inverse_factor = np.linalg.inv(self.factor)

    @classmethod
    def of(cls, z: FloatArray, weights: FloatArray | None = None) -> Normal:
        """The normal of a population (n, d); a small diagonal keeps a thin one regular."""
        covariance = np.cov(z.T, aweights=weights) + 1e-10 * np.eye(z.shape[1])
        return cls(np.average(z, axis=0, weights=weights), covariance)

    def whiten(self, z: FloatArray) -> FloatArray:
        """`z` (n, d) relative to the centre, in standard deviations."""
        return np.asarray((z - self.mean) @ self.inverse_factor.T)

    def colour(self, y: FloatArray) -> FloatArray:
        """The inverse of `whiten`."""
        return np.asarray(self.mean + y @ self.factor.T)


def move(
    problem: Problem,
    points: Points,
    floor: float,
    centre: Normal,
    step: float,
    moves: int,
    rng: np.random.Generator,
) -> tuple[Points, float]:
    """Moves all points `moves` times, the posterior of `floor` kept; gives the adapted step too."""
    density = _log_density(problem, points, floor)
    for _ in range(moves):
        proposal, log_ratio = _propose(problem, points, centre, step, rng)
        proposed_density = _log_density(problem, proposal, floor)
        accepted = np.log(rng.random(len(density))) < proposed_density - density + log_ratio
        points = points.replaced(accepted, proposal)
        density = np.where(accepted, proposed_density, density)
        step = float(np.clip(step * np.exp(0.5 * (accepted.mean() - _TARGET_ACCEPTANCE)), 0.05, 1))
    return points, step


def _log_density(problem: Problem, points: Points, floor: float) -> FloatArray:
    return problem.log_prior(points.z) + problem.log_likelihood(points, floor)


def _propose(
    problem: Problem, points: Points, centre: Normal, step: float, rng: np.random.Generator
) -> tuple[Points, FloatArray]:
    """A Crank-Nicolson step that keeps the t distribution around `centre`, and its log ratio."""
    nu, (n, d) = _DEGREES_OF_FREEDOM, points.z.shape
    y = centre.whiten(points.z)
    square = (y**2).sum(axis=1)
    precision = rng.gamma((d + nu) / 2, 1.0, n) / ((nu + square) / 2)
    noise = rng.standard_normal((n, d)) / np.sqrt(precision)[:, None]
    proposed = np.sqrt(1 - step**2) * y + step * noise
    proposed_square = (proposed**2).sum(axis=1)
    log_ratio = 0.5 * (d + nu) * (np.log1p(proposed_square / nu) - np.log1p(square / nu))
    return problem.evaluate(centre.colour(proposed)), log_ratio
