"""Least-squares search from dispersed starts: finds the narrow optimum that a population overlooks.

Frequencies good to 1e-4 confine the parameters to a needle whose share of the prior is so small
that no population meets it before the likelihood is already as narrow. Damped least squares
(Levenberg 1944, Marquardt 1963) does: starts soon lie in the valley that leads there, and the best
are followed to its end. The points found become anchors, from which the sampler proposes at every
stage with the covariance of that stage.

The hybrid: a cheap class's posterior says where to look for that of an expensive one. Parameters
that both classes share by name start from a widened t distribution of the warm start's samples, the
others from the prior; half of all starts come from the prior alone. The warm start is only a place
to start from: the importance weights correct for it, so that posterior and evidence are those
without it, and a wrong warm start costs half of the starts and no more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.inference.coordinates import log_normal, quantile
from shm.inference.described import DescribedCoordinates
from shm.inference.mixture import Normal, TMixture
from shm.inference.problem import Problem
from shm.models import DESCRIPTION
from shm.values import FloatArray, IntArray, Posterior

# Technical: as many starts from the prior as from where springs are felt; in three phases sigma
# follows the misfit, from that of a poor fit and of a good one; the best are followed to the end.
# A missed optimum shows as two seeds with unlike evidences (tests/benchmarks/sharp_evidence.py).
# Half or twice as many starts or last steps leave hanger 3's evidence within 0.01 of quadrature.
_STARTS = 40
_KEPT = 12
_PHASES, _STEPS, _LAST_STEPS = 3, 8, 80
_FIRST_SIGMA, _FELT_SIGMA = 0.02, 0.001
_APART = 0.1  # of the prior's standard deviation: nearer ones are one optimum
_DAMPING = 1e-2

# Technical: a normal around an optimum holds at most so much of the prior, in which the others are
# found by their own; a t needs it a little wider; a warm start is of another class.
_WIDEST = 0.4
_INFLATION = 1.3
_WIDER = 3.0
_FROM_PRIOR = 0.5


@dataclass(frozen=True, eq=False)
class Anchors:
    """Optima `z` (m, d), their model errors `sigma` (m,) and slopes (m, measurements, d)."""

    z: FloatArray
    sigma: FloatArray
    slopes: FloatArray
    problem: Problem

    def normals(self, floor: float) -> list[Normal]:
        """The normal approximation of the posterior around each anchor at this floor."""
        noise = _noise(self.problem, np.hypot(self.sigma, min(floor, 1.0)))
        scaled = self.slopes / noise[..., None]
        precision = np.einsum("mnd,mne->mde", scaled, scaled)
        precision += np.eye(self.problem.dimension) / _WIDEST**2
        covariances = _INFLATION * np.linalg.inv(precision)
        return [Normal(z, covariance) for z, covariance in zip(self.z, covariances, strict=True)]

    def log_evidence(self) -> FloatArray:
        """Log of the posterior's integral around each anchor (m,), were it normal there."""
        density = self.problem.log_posterior(self.problem.evaluate(self.z))
        log_volume = [np.log(np.diag(part.factor)).sum() for part in self.normals(0.0)]
        return np.asarray(density + log_volume + self.problem.dimension / 2 * np.log(2 * np.pi))


def search(
    problem: Problem, rng: np.random.Generator, warm_start: WarmStart | None = None
) -> Anchors:
    """The best distinct optima of `problem`; with a warm start half of the starts do."""
    z = (
        warm_start.draw(_STARTS // 2, rng)
        if warm_start
        else problem.coordinates.draw_prior(_STARTS, rng)
    )
    felt = problem.coordinates.draw_felt(_STARTS, rng)
    sigma = np.repeat([_FIRST_SIGMA, _FELT_SIGMA], [len(z), len(felt)])
    z = np.vstack([z, felt])
    for _ in range(_PHASES):
        z, sigma = _descend(problem, z, sigma, _STEPS)
    z = problem.coordinates.fold(z)
    problem.settle(z[_distinct(problem, z)[0]])
    promising = _distinct(problem, z)
    ends, _ = _descend(problem, z[promising], sigma[promising], _LAST_STEPS)
    z = np.vstack([z, problem.coordinates.fold(ends)])
    z = z[_distinct(problem, z)]
    return Anchors(z, _model_error(problem, z), problem.slopes(z), problem)


def carried(
    problem: Problem,
    z: FloatArray,
    sigma: FloatArray | float,
    rng: np.random.Generator,
    steps: int,
    start: FloatArray | None = None,
    damping: float = _DAMPING,
) -> FloatArray:
    """Draws `z` (m, d) of another distribution brought to this problem's data, by damped steps.

    Each goes to the least-squares optimum for its own draw of the noise, of model error `sigma`
    (m,), with its old place as the centre of the prior (randomised maximum likelihood, Oliver, He
    and Reynolds 1996): what the data say is made new, what they leave open is kept. The way begins
    at `start` (m, d) where it is given, else at the old place, and with that much `damping`.
    """
    sigmas = np.broadcast_to(sigma, len(z))
    noise = _noise(problem, sigmas)
    errors = noise * rng.standard_normal(noise.shape)
    begin = z if start is None else start
    ends, _ = _descend(problem, begin, sigmas, steps, z, errors, damping)
    return problem.coordinates.fold(ends)


def _model_error(problem: Problem, z: FloatArray) -> FloatArray:
    return problem.likelihood.model_error(problem.predict(z))


def _distinct(problem: Problem, z: FloatArray) -> IntArray:
    """Indices of the most probable points that lie apart from each other."""
    kept: list[int] = []
    for index in np.argsort(-problem.log_posterior(problem.evaluate(z))):
        if all(np.abs(z[index] - z[other]).max() > _APART for other in kept):
            kept.append(int(index))
    return np.array(kept[:_KEPT])


def _descend(
    problem: Problem,
    z: FloatArray,
    sigma: FloatArray,
    steps: int,
    centre: FloatArray | float = 0.0,
    errors: FloatArray | float = 0.0,
    first_damping: float = _DAMPING,
) -> tuple[FloatArray, FloatArray]:
    """All points `z` (m, d) moved downhill together, and their model errors `sigma` (m,) after.

    The prior stands around `centre`; the misfits (m, measurements) to reach are `errors`.
    """

    def fit(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        residual = (problem.likelihood.misfit(problem.predict(z)) - errors) / noise
        return residual, (residual**2).sum(axis=1) + ((z - centre) ** 2).sum(axis=1)

    noise = _noise(problem, sigma)
    damping = np.full(len(z), first_damping)
    residual, cost = fit(z)
    for _ in range(steps):
        step = _step(problem.slopes(z) / noise[..., None], residual, z - centre, damping)
        trial_residual, trial_cost = fit(z + step)
        better = trial_cost < cost
        z = np.where(better[:, None], z + step, z)
        residual = np.where(better[:, None], trial_residual, residual)
        cost = np.where(better, trial_cost, cost)
        damping = np.where(better, damping * 0.3, damping * 4).clip(1e-9, 1e8)
    return z, _model_error(problem, z)


def _noise(problem: Problem, sigma: FloatArray) -> FloatArray:
    """Fractional standard deviations (m, measurements) for model errors (m,)."""
    own = problem.likelihood.fit_error
    return np.asarray(np.hypot(sigma[:, None], own))


def _step(
    slopes: FloatArray, residual: FloatArray, away: FloatArray, damping: FloatArray
) -> FloatArray:
    """The damped Gauss-Newton step (m, d) of points `away` (m, d) from the prior's centre.

    At most 1 in each direction.
    """
    normal = np.einsum("mnd,mne->mde", slopes, slopes) + np.eye(away.shape[1])
    gradient = np.einsum("mnd,mn->md", slopes, residual) + away
    diagonal = np.einsum("mdd->md", normal) * damping[:, None]
    damped = normal + diagonal[..., None] * np.eye(away.shape[1])
    return -np.linalg.solve(damped, gradient[..., None])[..., 0].clip(-1, 1)


class WarmStart:
    """A density of starts for `problem` that follows another class's posterior.

    Parameters that ends can exchange are never shared: their names do not say which end.
    """

    def __init__(self, problem: Problem, posterior: Posterior):
        self._problem = problem
        self._columns, z = _shared_places(problem, posterior)
        found = Normal.of(z)
        self._near = TMixture([Normal(found.mean, _WIDER**2 * found.covariance)], np.ones(1))

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Starts (n, d), all inside the fold."""
        z = self._problem.coordinates.draw_prior(n, rng)
        hinted = rng.random(n) >= _FROM_PRIOR
        z[np.ix_(hinted, self._columns)] = self._near.draw(int(hinted.sum()), rng)
        return z

    def log_ratio(self, z: FloatArray) -> FloatArray:
        """Log of the density of starts over that of the prior (n,) at `z` (n, d)."""
        shared = z[:, self._columns]
        near = self._near.log_density(shared) - log_normal(shared)
        return np.asarray(np.logaddexp(np.log(_FROM_PRIOR), np.log1p(-_FROM_PRIOR) + near))


def warm_start_from(problem: Problem, posterior: Posterior | None) -> WarmStart | None:
    """The warm start that a posterior gives; None where there is none or no parameter is shared."""
    if posterior is None or not len(_shared_places(problem, posterior)[0]):
        return None
    return WarmStart(problem, posterior)


def _shared_places(problem: Problem, posterior: Posterior) -> tuple[IntArray, FloatArray]:
    """Which columns of z the posterior knows, and its draws there (n, columns)."""
    coordinates = problem.coordinates
    if isinstance(coordinates, DescribedCoordinates):
        if posterior.priors != DESCRIPTION:
            return np.empty(0, dtype=int), np.empty((0, 0))
        return coordinates.shared(posterior.names, posterior.samples)
    # What ends can exchange is not shared.
    known = set(posterior.names) - {name for swap in problem.model.swaps for name in swap}
    columns = np.array([i for i, n in enumerate(problem.prior.names) if n in known], dtype=int)
    lower, upper = problem.prior.lower[columns], problem.prior.upper[columns]
    names = [problem.prior.names[i] for i in columns]
    samples = np.array([posterior.parameter(name) for name in names])
    samples = samples.reshape(len(names), len(posterior.samples)).T
    return columns, quantile((samples - lower) / (upper - lower))
