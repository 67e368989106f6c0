"""Transitional Markov chain Monte Carlo (Ching and Chen 2007, J. Eng. Mech. 133(7), 816-832).

A population goes from the prior to the posterior in stages; each next stage is as far away as a
coefficient of variation of the weights of 2 allows; the population is resampled and moved.

The likelihood is not raised to a power, as in the paper: on this problem that path meets a
phase transition (the model error sigma collapses at some power) and its evidence is biased by -1 to
-7. Instead a fictitious error `floor` is added to the variance of the likelihood and lowered from
infinity (the prior) to 0 (the posterior). A stage makes several moves:
t-preconditioned Crank-Nicolson steps (Grumitt, Karamanis and Seljak 2023), which suit the heavy
tails better than a random walk, and independent proposals that jump between the population and the
anchors of a least-squares search. Since the evidence comes from a last step
(`shm.inference.importance`), few particles and long strides do.
"""

from __future__ import annotations

import numpy as np

from shm.inference.mixture import Normal, TMixture, normalised, systematic
from shm.inference.problem import Points, Problem
from shm.inference.search import Anchors, WarmStart
from shm.values import FloatArray

# Technical: longer strides than the paper's 1, since the last step corrects what they leave.
_TARGET_VARIATION = 2.0
_ROUNDS = 4
_DEGREES_OF_FREEDOM = 5.0  # judgement: heavier tails than a normal, with a finite variance

_TARGET_ACCEPTANCE = 0.3  # between 0.44 in one dimension and 0.23 in many (Roberts, Rosenthal 2001)

# Below any error of a frequency; where the likelihood is flat.
_SMALLEST_FLOOR = 1e-9
_LARGEST_FLOOR = 1e3


def sample(
    problem: Problem,
    anchors: Anchors,
    particles: int,
    rng: np.random.Generator,
    warm_start: WarmStart | None = None,
) -> list[FloatArray]:
    """The places (n, d) that `particles` points went through in each stage.

    The last of them is the posterior's; the others are wider. With a warm start the first points
    are its draws, weighed towards the prior.
    """
    points = problem.evaluate(
        warm_start.draw(particles, rng)
        if warm_start
        else problem.coordinates.draw_prior(particles, rng)
    )
    current = warm_start.log_ratio(points.z) if warm_start else np.zeros(particles)
    floor, step = np.inf, 0.6
    stages: list[FloatArray] = []
    while floor > 0:
        floor = _next_floor(problem, points, current, floor)
        weights = normalised(problem.likelihood.marginal(points.predicted, floor) - current)
        mover = Mover(problem, floor, Normal.of(points.z, weights), step)
        trail = mover.move(points.take(systematic(weights, particles, rng)), anchors, rng)
        points = trail[-1]
        stages.append(np.vstack([place.z for place in trail]))
        step, current = mover.step, problem.likelihood.marginal(points.predicted, floor)
    return stages


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


class Mover:
    """Moves points so that the posterior at one floor is kept; adapts its step as it goes."""

    def __init__(self, problem: Problem, floor: float, centre: Normal, step: float):
        self.step = step
        self._problem = problem
        self._floor = floor
        self._centre = centre

    def move(self, points: Points, anchors: Anchors, rng: np.random.Generator) -> list[Points]:
        """Where the points are after each round of two local steps and one jump."""
        normals = anchors.normals(self._floor)
        shares = np.append(np.full(len(normals), 1 / len(normals)), 1.0)
        jumps = TMixture([*normals, self._centre], shares)
        density = self._problem.log_posterior(points, self._floor)
        trail = []
        for _ in range(_ROUNDS):
            points, density = self._walk(points, density, 2, rng)
            proposal = self._jump(points, jumps, rng)
            points, density, _ = self._accept(points, density, *proposal, rng)
            trail.append(points)
        return trail

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
        return proposal.where(accepted, points), density, float(accepted.mean())

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
