"""Updating from what is known: the posterior of new tests, started from an earlier one's draws.

The known posterior only says where to look. Prior, likelihood and answer are those of `update`:
the draws of the known posterior are carried to the new data by least squares, a t mixture fitted to
them is the proposal of the same adaptive importance sampling, and the weights correct whatever the
old draws had wrong. Shares of the prior and of the anchors of a fresh search are in the proposal,
lest the known posterior have lost a mode or the hanger have changed.

Where the weights are not to be trusted, the affine-invariant ensemble sampler emcee (Foreman-Mackey
et al. 2013), started from the weighted draws, makes the population anew and it is weighed again.
Where they are still not, `update` starts from scratch. The posterior's `method` says which it was.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.inference.importance import FARTHEST, Weighted, weigh
from shm.inference.options import Progress, UpdateOptions, silent
from shm.inference.outcome import posterior_of
from shm.inference.priors import reading_of
from shm.inference.problem import Problem
from shm.inference.search import Anchors, carried, search
from shm.inference.updating import ENOUGH, update
from shm.models import Model
from shm.values import FloatArray, ModalTest, Posterior

RE_WEIGHTED = "re-weighted"
ENSEMBLE = "ensemble"

# Technical: the population that the first mixture is fitted to, some 150 points: those known are
# near and take few steps, those of the prior more; noise a little larger than the model error keeps
# a proposal wider than the posterior. Held against updates from scratch in
# tests/benchmarks/updating_from_known.py, as is the ensemble: 40 steps from draws that are weighed.
_KNOWN, _FRESH, _FROM_EACH_ANCHOR = 80, 80, 20
_KNOWN_STEPS, _FRESH_STEPS, _WIDE_STEPS = 5, 9, 1
_NOISE, _WIDE_NOISE = 1.5, 6.0
_WALKERS, _STEPS, _THINNED = 300, 40, 5

# Judgement: where a re-weighting is trusted, or worth an ensemble; below, the update is begun from
# scratch, which costs time alone (docs/inference.md, Sampler).
_FEWEST = 0.25
_HOPELESS = 0.05
_LEAST_SPREAD = 0.7

_WORST_TAIL = 0.7  # Vehtari et al. 2024, see `tail_index`


def refresh(
    tests: Sequence[ModalTest],
    model: Model,
    known: Posterior,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
) -> Posterior:
    """The posterior of `model` given `tests` alone, found from a `known` one of the same class.

    The same posterior as that of `update`, within Monte Carlo error, for less work; the
    same seed, tests and known posterior give the same draws. `options.method` counts where it
    comes to a start from scratch. Raises UsageError where the known posterior is of another class,
    BadInput as `update` does.
    """
    options = options or UpdateOptions()
    _refuse_stranger(model, known)
    if reading_of(tests) is not None:  # rare, and to be held against what frequencies alone say
        return update(tests, model, options, progress)
    problem = Problem.of(tests, model, options.repeat, progress, options.calibration)
    started = time.perf_counter()
    rng = np.random.default_rng(options.seed)
    progress(model.name, 0.0)
    method, weighted = _found(problem, known, options.samples, rng, progress)
    if weighted is None:
        fresh = update(tests, model, options, progress)
        spent, seconds = problem.evaluations, time.perf_counter() - started
        return replace(fresh, evaluations=fresh.evaluations + spent, seconds=seconds)
    progress(model.name, 1.0)
    return posterior_of(problem, weighted, tests, options, rng, started, method)


def _refuse_stranger(model: Model, known: Posterior) -> None:
    if known.model != model.name or known.names[:-1] != model.parameter_names:
        raise UsageError(
            f"a known posterior of model class {known.model} says nothing about {model.name}.",
            remedy="Give one of the same class, or use `update`.",
        )


def _found(
    problem: Problem, known: Posterior, samples: int, rng: np.random.Generator, progress: Progress
) -> tuple[str, Weighted | None]:
    """The first way whose draws can be trusted, and these; None where none can."""
    anchors = search(problem, rng)
    progress(problem.model.name, 0.2)
    population, wide = _population(problem, known, anchors, rng)
    weighted = weigh(problem, population, anchors, ENOUGH * samples, rng, [wide])
    if trusted(weighted, samples):
        return RE_WEIGHTED, weighted
    # An ensemble that starts from next to nothing costs more than it saves.
    if weighted.effective_sample_size < _HOPELESS * samples:
        return RE_WEIGHTED, None
    progress(problem.model.name, 0.5)
    chain = _ensemble(problem, weighted, population, rng)
    weighted = weigh(problem, chain, anchors, ENOUGH * samples, rng, [wide])
    agrees = trusted(weighted, samples) and _as_wide(weighted, chain, samples, rng)
    return ENSEMBLE, weighted if agrees else None


def _population(
    problem: Problem, known: Posterior, anchors: Anchors, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Points (n, d) about where the new posterior is, and wider ones.

    Draws of the known posterior and of the prior, both carried to the new data, and some around
    each anchor. The known draws would not do alone: a valley that the old data closed and the new
    ones open has none of them.
    """
    noise = _NOISE * float(anchors.sigma[0])
    known_z = _places(problem, known)
    chosen = known_z[rng.permutation(len(known_z))[:_KNOWN]]
    fresh = problem.coordinates.draw_prior(_FRESH, rng)
    near = [normal.draw_t(_FROM_EACH_ANCHOR, rng) for normal in anchors.normals(0.0)]
    population = np.vstack(
        [
            carried(problem, chosen, noise, rng, _KNOWN_STEPS),
            carried(problem, fresh, noise, rng, _FRESH_STEPS),
            problem.coordinates.fold(np.vstack(near)),
        ]
    )
    density = problem.log_posterior(problem.evaluate(population))
    population = population[density > density.max() - FARTHEST]
    wide = carried(problem, population, _WIDE_NOISE / _NOISE * noise, rng, _WIDE_STEPS)
    return population, wide


def _places(problem: Problem, known: Posterior) -> FloatArray:
    """The known draws as points (n, d), folded."""
    return problem.coordinates.places(known.samples[:, :-1])


def trusted(weighted: Weighted, samples: int) -> bool:
    """Whether the effective draws are enough for `samples`, and the weights' tail light enough."""
    if weighted.effective_sample_size < _FEWEST * samples:
        return False
    return tail_index(weighted.log_weights) <= _WORST_TAIL


def _as_wide(weighted: Weighted, chain: FloatArray, samples: int, rng: np.random.Generator) -> bool:
    """Whether the weighted draws spread in each direction as the ensemble's points (n, d) do."""
    spread = weighted.resampled(samples, rng).z.std(axis=0) / chain.std(axis=0)
    return bool(spread.min() > _LEAST_SPREAD)


def tail_index(log_weights: FloatArray) -> float:
    """Shape k of the generalised Pareto distribution of the largest weights (n,).

    Above 0.7 the mean of the weights converges too slowly to be used (Vehtari, Simpson, Gelman,
    Yao and Gabry 2024, J. Mach. Learn. Res. 25(72)). The fit is that of Zhang and Stephens (2009),
    drawn to 0.5 as Vehtari et al. do.
    """
    weights = np.sort(np.exp(log_weights - log_weights.max()))
    tail = int(min(len(weights) / 5, 3 * np.sqrt(len(weights))))
    excess = weights[-tail:] - weights[-tail - 1]
    tries = np.arange(1, 31 + int(np.sqrt(tail)))
    quartile = excess[int(tail / 4 + 0.5) - 1]
    theta = 1 / excess[-1] + (1 - np.sqrt(tries[-1] / (tries - 0.5))) / (3 * quartile)
    shape = np.log1p(-theta[:, None] * excess).mean(axis=1)
    log_likelihood = tail * (np.log(-theta / shape) - shape - 1)
    share = np.exp(log_likelihood - log_likelihood.max())
    best = (theta * share).sum() / share.sum()
    k = np.log1p(-best * excess).mean()
    return float((tail * k + 5) / (tail + 10))


def _ensemble(
    problem: Problem, weighted: Weighted, population: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Points (n, d) of the posterior by emcee, started from the best draws and the population."""
    # Its moves load all of scipy.stats, and most posteriors need none of them.
    from emcee import EnsembleSampler
    from emcee.moves import DEMove, KDEMove

    lots = weighted.log_weights + rng.gumbel(size=len(weighted.log_weights))
    drawn = weighted.points.z[np.argsort(-lots)[: _WALKERS - _WALKERS // 2]]
    chosen = rng.permutation(len(population))[: _WALKERS // 2]
    start = np.vstack([drawn, population[chosen]])
    start = start[: len(start) // 2 * 2]

    def log_posterior(z: FloatArray) -> FloatArray:
        found = problem.coordinates.log_prior(z)
        inside = np.isfinite(found)
        points = problem.evaluate(z[inside])
        found[inside] += problem.likelihood.marginal(points.predicted)
        return found

    sampler = EnsembleSampler(
        len(start),
        problem.dimension,
        log_posterior,
        moves=[(DEMove(), 0.8), (KDEMove(), 0.2)],
        vectorize=True,
    )
    sampler.random_state = np.random.RandomState(rng.integers(2**32)).get_state()
    sampler.run_mcmc(start, _STEPS, skip_initial_state_check=True)
    return np.asarray(sampler.get_chain(discard=_STEPS // 3, thin=_THINNED, flat=True))
