"""Posterior of one model class, from scratch or from a known one, and the choice among several.

A known posterior, of earlier tests, only says where to look. Prior, likelihood and answer are those
of `update`: the draws of the known posterior are carried to the new data by least squares, a t
mixture fitted to them is the proposal of the same adaptive importance sampling, and the weights
correct whatever the old draws had wrong. Shares of the prior and of the anchors of a fresh search
are in the proposal, lest the known posterior have lost a mode or the hanger have changed.

Where the weights are not to be trusted, the affine-invariant ensemble sampler emcee (Foreman-Mackey
et al. 2013), started from the weighted draws, makes the population anew and it is weighed again.
Where they are still not, `update` starts from scratch. The posterior's `method` says which it was.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.inference.importance import FARTHEST, Weighted, weigh
from shm.inference.mixture import normalised
from shm.inference.options import Progress, UpdateOptions, silent
from shm.inference.other_answers import reading_off_sd
from shm.inference.outcome import posterior_of
from shm.inference.priors import reading_of
from shm.inference.problem import Problem
from shm.inference.search import Anchors, WarmStart, carried, search, warm_start_from
from shm.inference.tmcmc import sample
from shm.models import THESIS, AsMade, Model
from shm.values import ENOUGH_EFFECTIVE, NAN, FloatArray, ModalTest, Posterior, Selection

# Technical: few particles do, since the last step weighs (`shm.inference.tmcmc`); 200 are
# twenty or more for each parameter.
_SAMPLES_A_PARTICLE = 5
_FEWEST_PARTICLES = 200

_DRAWS_WITHOUT_READING = 1000  # for the quartiles

ENOUGH = 0.5
"""Effective draws for each sample to keep; fewer repeat draws, more cost in proportion."""

_AGAIN = (3, 9)
"""Times as many particles in a second and a third attempt, where the draws are too few or the tail
of their weights is heavy."""


def update(
    tests: Sequence[ModalTest],
    model: Model,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
    warm_start: Posterior | None = None,
) -> Posterior:
    """The posterior of `model` given all modes of `tests`.

    The sampler finds the posterior, importance sampling gives the evidence and the draws (`r_hat`
    is the agreement of their batches), and a few steps spread equal draws. `warm_start`, the
    posterior of another class on the same tests, saves evaluations and changes nothing else.
    `progress` hears the model's name and the fraction done. Raises BadInput where a test has no
    modes or conditions that the model class cannot describe.
    """
    options = options or UpdateOptions()
    problem = Problem.of(tests, model, progress, options.calibration)
    started = time.perf_counter()
    rng = np.random.default_rng(options.seed)
    progress(model.name, 0.0)
    weighted = infer(problem, options.samples, rng, progress, warm_start)
    progress(model.name, 1.0)
    found = posterior_of(problem, weighted, tests, options, rng, started)
    return replace(found, reading_off_sd=_off_the_reading(tests, model, options, rng))


def _off_the_reading(
    tests: Sequence[ModalTest], model: Model, options: UpdateOptions, rng: np.random.Generator
) -> float:
    """How far a tension that was read is off what the frequencies alone say; NaN without one."""
    reading = reading_of(tests, model.hanger.assumptions)
    if reading is None or model.priors == THESIS:
        return NAN
    unread = [replace(each, tension_read_n=NAN, tension_read_sd_n=NAN) for each in tests]
    problem = Problem.of(unread, model, silent, options.calibration)
    drawn = infer(problem, _DRAWS_WITHOUT_READING, rng).resampled(_DRAWS_WITHOUT_READING, rng)
    theta = problem.coordinates.finished(drawn.z, rng)
    return reading_off_sd(np.log(theta[:, 0]), reading, model.hanger.nominal_tension_n)


def infer(
    problem: Problem,
    samples: int,
    rng: np.random.Generator,
    progress: Progress = silent,
    warm_start: Posterior | None = None,
) -> Weighted:
    """Weighted draws of the posterior of any `problem`, enough for `samples` equal ones.

    Where fewer than 200 are effective, or their weights have a heavy tail, it goes on with more
    particles; `Posterior.caveats` says so where too few remain.
    """
    near = warm_start_from(problem, warm_start)
    particles = max(samples // _SAMPLES_A_PARTICLE, _FEWEST_PARTICLES)
    attempts = [_weighted(problem, samples, particles, rng, progress, near)]
    for more in _AGAIN:
        if _sound(attempts[-1], samples):
            return attempts[-1]
        # Other anchors and slower stages; the posterior is the same.
        attempts.append(_weighted(problem, samples, more * particles, rng, progress))
    return max(attempts, key=lambda each: (_sound(each, samples), each.effective_sample_size))


def _sound(weighted: Weighted, samples: int) -> bool:
    enough = weighted.effective_sample_size >= min(ENOUGH_EFFECTIVE, samples)
    return enough and weighted.light_tailed


def _weighted(
    problem: Problem,
    samples: int,
    particles: int,
    rng: np.random.Generator,
    progress: Progress,
    near: WarmStart | None = None,
) -> Weighted:
    anchors = search(problem, rng, near)
    progress(problem.model.name, 0.2)
    *wider, population = sample(problem, anchors, particles, rng, near)
    progress(problem.model.name, 0.7)
    return weigh(problem, population, anchors, ENOUGH * samples, rng, wider)


def select(
    tests: Sequence[ModalTest],
    models: Sequence[Model],
    options: UpdateOptions | None = None,
    progress: Progress = silent,
    class_priors: Mapping[str, float] | None = None,
) -> Selection:
    """The posteriors of all `models`, most probable first.

    Before any data they are as probable as `class_priors` says of each by name, in any scale.
    Without it, equally; with the priors of a description, a class that holds its ends fast is then
    as probable as all ends being stiffer than the springs of other classes reach.
    Expensive classes come last and start from the likeliest of the cheap ones. Thesis (4.15) to
    (4.17). Raises UsageError where no model is given or `class_priors` are not of these,
    BadInput as `update` does.
    """
    if not models:
        raise UsageError("no model class to select from.", remedy="Name at least one.")
    if class_priors is not None:
        _check_priors(class_priors, [model.name for model in models])
    cheap = [update(tests, m, options, progress) for m in models if not m.expensive]
    best = max(cheap, key=lambda posterior: posterior.log_evidence, default=None)
    costly = [update(tests, m, options, progress, best) for m in models if m.expensive]
    found = [*cheap, *costly]
    chances = class_probabilities(found, models, tests, class_priors)
    order = np.argsort([-chances[each.model] for each in found], kind="stable")
    chosen = tuple(found[k] for k in order)
    return Selection(chosen, tuple(chances[each.model] for each in chosen))


def class_probabilities(
    posteriors: Sequence[Posterior],
    models: Sequence[Model],
    tests: Sequence[ModalTest],
    class_priors: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """The probability of each class, by name, of its posterior's evidence and before any data."""
    if class_priors is None:
        prior = {model.name: _log_prior(model, tests) for model in models}
    else:
        prior = {name: float(np.log(stated)) for name, stated in class_priors.items()}
    log = np.array([each.log_evidence + prior[each.model] for each in posteriors])
    weights = normalised(log)
    return {each.model: float(w) for each, w in zip(posteriors, weights, strict=True)}


def _check_priors(class_priors: Mapping[str, float], names: Sequence[str]) -> None:
    odd = sorted(set(names) ^ set(class_priors))
    odd += [name for name, stated in class_priors.items() if not 0 < stated < np.inf]
    if odd:
        raise UsageError(
            f"prior of {', '.join(odd)}: each class compared needs one above 0, no other has one.",
            remedy=f"Give them of {', '.join(names)}, or none at all.",
        )


def _log_prior(model: Model, tests: Sequence[ModalTest]) -> float:
    """Log of how probable a class is before any data, beside one of springs.

    No end is perfectly clamped: a rigid end stands for springs in the decade beyond the range, as
    probable as any decade within it.
    """
    if not isinstance(model, AsMade) or model.springs:
        return 0.0
    planes = {mode.plane for test in tests for mode in test.regular_modes}
    one = 1 / (1 + model.hanger.assumptions.end_restraint.decades)
    # Springs each by itself, all alike, alike in each plane, or made to clamp (`EndDetails`): as
    # many of these are beyond the stiffest decade as are in it. Round ends each by itself or alike.
    shares = [one ** (2 * len(planes)), one, one ** len(planes), 0.5]
    if len(planes) > 1 and model.hanger.plate is None:
        shares += [one**2, one]
    return float(np.log(np.mean(shares)))


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


def refresh(
    tests: Sequence[ModalTest],
    model: Model,
    known: Posterior,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
) -> Posterior:
    """The posterior of `model` given `tests` alone, found from a `known` one of the same class.

    The same posterior as that of `update`, within Monte Carlo error, for less work; the
    same seed, tests and known posterior give the same draws. Raises UsageError where the known
    posterior is of another class, BadInput as `update` does.
    """
    options = options or UpdateOptions()
    _refuse_stranger(model, known)
    if reading_of(tests) is not None:  # rare, and to be held against what frequencies alone say
        return update(tests, model, options, progress)
    problem = Problem.of(tests, model, progress, options.calibration)
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
    return weighted.effective_sample_size >= _FEWEST * samples and weighted.light_tailed


def _as_wide(weighted: Weighted, chain: FloatArray, samples: int, rng: np.random.Generator) -> bool:
    """Whether the weighted draws spread in each direction as the ensemble's points (n, d) do."""
    spread = weighted.resampled(samples, rng).z.std(axis=0) / chain.std(axis=0)
    return bool(spread.min() > _LEAST_SPREAD)


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
