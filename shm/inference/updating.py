"""Posterior of one model class, and the choice among several, given modal tests.

TMCMC as Ching and Chen (2007, J. Eng. Mech. 133(7), 816-832) and the thesis (4.3) have it.

The likelihood is raised to a power b that goes from 0 to 1, each step as far as a coefficient of
variation of the weights of 1 allows; the model error sigma is a sampled parameter; a particle that
is resampled k times makes a chain of k random-walk Metropolis steps, whose covariance is 0.2^2
times that of the weighted population; the evidence is the product of the mean weights.

It is here for fidelity. On hangers its evidence is wrong, for sigma collapses at some power: a
phase transition that the population does not follow.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.inference.importance import Weighted, weigh
from shm.inference.mixture import Normal
from shm.inference.options import TEXTBOOK, Progress, UpdateOptions, silent
from shm.inference.other_answers import Outcome, reading_off_sd
from shm.inference.outcome import assembled, posterior_of
from shm.inference.priors import DECADES, reading_of
from shm.inference.problem import Points, Problem
from shm.inference.search import WarmStart, search, warm_start_from
from shm.inference.tmcmc import normalised, sample
from shm.models import THESIS, AsMade, Model
from shm.values import (
    ENOUGH_EFFECTIVE,
    NAN,
    BoolArray,
    FloatArray,
    IntArray,
    ModalTest,
    Posterior,
    Selection,
)

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


__all__ = ["Progress", "UpdateOptions", "infer", "posterior_of", "select", "silent", "update"]

# Technical: few particles do, since the last step weighs (`shm.inference.tmcmc`); 200 are
# twenty or more for each parameter.
_SAMPLES_A_PARTICLE = 5
_FEWEST_PARTICLES = 200

_DRAWS_WITHOUT_READING = 1000  # for the quartiles

ENOUGH = 0.5
"""Effective draws for each sample to keep; fewer repeat draws, more cost in proportion."""

_AGAIN = (3, 9)
"""Times as many particles in a second and a third attempt, where the draws were too few."""


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
    modes or conditions that the model class cannot describe, UsageError where the textbook method
    or a data set that counts twice meets priors of the description. Warns (BiasedEvidenceWarning)
    about the method.
    """
    options = options or UpdateOptions()
    if options.method == TEXTBOOK and model.priors != THESIS:
        raise UsageError(
            "the textbook's sampler is the thesis's: it draws the model error uniformly and has no "
            "part in the noise of the field.",
            remedy="Leave the method out, or take the priors of the thesis.",
        )
    if options.method == TEXTBOOK and options.sigma != "one":
        raise UsageError(
            "the textbook's sampler draws one model error.", remedy="Leave the method or sigma out."
        )
    problem = Problem.of(tests, model, options.repeat, progress, options.calibration, options.sigma)
    started = time.perf_counter()
    rng = np.random.default_rng(options.seed)
    progress(model.name, 0.0)
    if options.method == TEXTBOOK:
        outcome = textbook(problem, options.samples, rng)
        progress(model.name, 1.0)
        return assembled(problem, outcome, tests, options, started)
    weighted = infer(problem, options.samples, rng, progress, warm_start)
    progress(model.name, 1.0)
    found = posterior_of(problem, weighted, tests, options, rng, started)
    return replace(found, reading_off_sd=_off_the_reading(tests, model, options, rng))


def _off_the_reading(
    tests: Sequence[ModalTest], model: Model, options: UpdateOptions, rng: np.random.Generator
) -> float:
    """How far a tension that was read is off what the frequencies alone say; NaN without one."""
    reading = reading_of(tests)
    if reading is None or model.priors == THESIS:
        return NAN
    unread = [replace(each, tension_read_n=NAN, tension_read_sd_n=NAN) for each in tests]
    problem = Problem.of(unread, model, 1, silent, options.calibration)
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

    Where fewer than 200 are effective it goes on with more particles; `Posterior.caveats` says so
    where that did not help.
    """
    near = warm_start_from(problem, warm_start)
    particles = max(samples // _SAMPLES_A_PARTICLE, _FEWEST_PARTICLES)
    best = _weighted(problem, samples, particles, rng, progress, near)
    for more in _AGAIN:
        if best.effective_sample_size >= min(ENOUGH_EFFECTIVE, samples):
            break
        # Other anchors and slower stages; the posterior is the same.
        again = _weighted(problem, samples, more * particles, rng, progress)
        best = max(best, again, key=lambda each: each.effective_sample_size)
    return best


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

    No end is perfectly clamped: a rigid end stands for springs in the decade beyond `RESTRAINT`, as
    probable as any decade within it.
    """
    if not isinstance(model, AsMade) or model.springs:
        return 0.0
    planes = {mode.plane for test in tests for mode in test.regular_modes}
    one = 1 / (1 + DECADES)
    # Springs each by itself, all alike, alike in each plane, or made to clamp (`EndDetails`): as
    # many of these are beyond the stiffest decade as are in it. Round ends each by itself or alike.
    shares = [one ** (2 * len(planes)), one, one ** len(planes), 0.5]
    if len(planes) > 1 and model.hanger.plate is None:
        shares += [one**2, one]
    return float(np.log(np.mean(shares)))
