"""Transitional Markov chain Monte Carlo (Ching and Chen 2007, J. Eng. Mech. 133(7), 816-832).

A population goes from the prior to the posterior in stages; each next stage is as far away as a
coefficient of variation of the weights of 1 allows; the population is resampled and moved.

Two things differ from the textbook. The likelihood is not raised to a power: on this problem that
path meets a phase transition (the model error sigma collapses at some power) and its evidence is
biased by 1 to 4. Instead a fictitious error `floor` is added to the variance of the likelihood and
lowered from infinity (the prior) to 0 (the posterior). And a stage makes several moves: t-
preconditioned Crank-Nicolson steps (Grumitt, Karamanis and Seljak 2023), which suit the heavy tails
better than a random walk, and independent proposals that jump between the population and the
anchors of a least-squares search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.update.mixture import Normal, TMixture
from shm.update.problem import Points, Problem
from shm.update.search import Anchors
from shm.values import FloatArray, IntArray

_TARGET_VARIATION = 1.0
_TARGET_ACCEPTANCE = 0.3
_ROUNDS = 3
_DEGREES_OF_FREEDOM = 5.0
_SMALLEST_FLOOR = 1e-9
_LARGEST_FLOOR = 1e3


@dataclass(frozen=True, eq=False)
class Population:
    """Points of the posterior and the log evidence that their stages add up to."""

    points: Points
    log_evidence: float


def sample(
    problem: Problem, anchors: Anchors, particles: int, rng: np.random.Generator
) -> Population:
    """`particles` points of the posterior of `problem`."""
    points = problem.evaluate(problem.draw_prior(particles, rng))
    floor, current, step, log_evidence = np.inf, np.zeros(particles), 0.6, 0.0
    while floor > 0:
        floor = _next_floor(problem, points, current, floor)
        log_weights = problem.likelihood.marginal(points.predicted, floor) - current
        log_evidence += float(np.logaddexp.reduce(log_weights) - np.log(particles))
        weights = normalised(log_weights)
        mover = Mover(problem, floor, Normal.of(points.z, weights), step)
        points = points.take(systematic(weights, particles, rng))
        points = mover.move(points, anchors, rng)
        step, current = mover.step, problem.likelihood.marginal(points.predicted, floor)
    return Population(points, log_evidence)


def _next_floor(problem: Problem, points: Points, current: FloatArray, floor: float) -> float:
    """The lowest floor whose weights keep the target variation; 0 once that is in reach."""

    def too_far(candidate: float) -> bool:
        log_weights = problem.likelihood.marginal(points.predicted, candidate) - current
        weights = normalised(log_weights)
        return bool(weights.std() > _TARGET_VARIATION * weights.mean())

    if not too_far(0.0):
        return 0.0
    low, high = np.log(_SMALLEST_FLOOR), np.log(min(floor, _LARGEST_FLOOR))
    for _ in range(25):
        middle = (low + high) / 2
        low, high = (middle, high) if too_far(np.exp(middle)) else (low, middle)
    return float(np.exp(high))


def normalised(log_weights: FloatArray) -> FloatArray:
    """Weights (n,) that add to 1."""
    weights = np.exp(log_weights - log_weights.max())
    return np.asarray(weights / weights.sum())


def systematic(weights: FloatArray, n: int, rng: np.random.Generator) -> IntArray:
    """Indices (n,) drawn with `weights` by systematic resampling."""
    positions = (np.arange(n) + rng.random()) / n
    return np.searchsorted(np.cumsum(weights), positions).clip(0, len(weights) - 1).astype(int)


class Mover:
    """Moves points so that the posterior at one floor is kept; adapts its step as it goes."""

    def __init__(self, problem: Problem, floor: float, centre: Normal, step: float):
        self.step = step
        self._problem = problem
        self._floor = floor
        self._centre = centre

    def move(self, points: Points, anchors: Anchors, rng: np.random.Generator) -> Points:
        """Rounds of two local steps and one jump."""
        normals = anchors.normals(self._floor)
        shares = np.append(np.full(len(normals), 1 / len(normals)), 1.0)
        jumps = TMixture([*normals, self._centre], shares)
        density = self._problem.log_posterior(points, self._floor)
        for _ in range(_ROUNDS):
            points, density = self._walk(points, density, 2, rng)
            proposal = self._jump(points, jumps, rng)
            points, density, _ = self._accept(points, density, *proposal, rng)
        return points

    def walk(self, points: Points, steps: int, rng: np.random.Generator) -> Points:
        """Local steps alone."""
        density = self._problem.log_posterior(points, self._floor)
        return self._walk(points, density, steps, rng)[0]

    def _walk(
        self, points: Points, density: FloatArray, steps: int, rng: np.random.Generator
    ) -> tuple[Points, FloatArray]:
        for _ in range(steps):
            proposal = self._crank_nicolson(points, rng)
            points, density, rate = self._accept(points, density, *proposal, rng)
            factor = np.exp(0.5 * (rate - _TARGET_ACCEPTANCE))
            self.step = float(np.clip(self.step * factor, 0.02, 1))
        return points, density

    def _accept(
        self,
        points: Points,
        density: FloatArray,
        proposal: Points,
        log_ratio: FloatArray,
        rng: np.random.Generator,
    ) -> tuple[Points, FloatArray, float]:
        """Metropolis and Hastings: points, their log posterior `density`, rate of acceptance."""
        proposed = self._problem.log_posterior(proposal, self._floor)
        accepted = np.log(rng.random(len(density))) < proposed - density + log_ratio
        density = np.where(accepted, proposed, density)
        return points.replaced(accepted, proposal), density, float(accepted.mean())

    def _crank_nicolson(
        self, points: Points, rng: np.random.Generator
    ) -> tuple[Points, FloatArray]:
        """A step that keeps the t distribution around the centre, and its log ratio."""
        nu, (n, d) = _DEGREES_OF_FREEDOM, points.z.shape
        y = self._centre.whiten(points.z)
        square = (y**2).sum(axis=1)
        precision = rng.gamma((d + nu) / 2, 1.0, n) / ((nu + square) / 2)
        noise = rng.standard_normal((n, d)) / np.sqrt(precision)[:, None]
        proposed = np.sqrt(1 - self.step**2) * y + self.step * noise
        proposed_square = (proposed**2).sum(axis=1)
        log_ratio = (d + nu) / 2 * (np.log1p(proposed_square / nu) - np.log1p(square / nu))
        return self._problem.evaluate(self._centre.colour(proposed)), log_ratio

    def _jump(
        self, points: Points, jumps: TMixture, rng: np.random.Generator
    ) -> tuple[Points, FloatArray]:
        """An independent proposal and its log ratio."""
        z = jumps.draw(len(points.z), rng)
        return self._problem.evaluate(z), jumps.log_density(points.z) - jumps.log_density(z)
