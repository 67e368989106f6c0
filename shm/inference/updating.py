"""Posterior of one model class, and the choice among several, given modal tests."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.inference.importance import Weighted, weigh
from shm.inference.mixture import normalised
from shm.inference.options import TEXTBOOK, Progress, UpdateOptions, silent
from shm.inference.other_answers import reading_off_sd
from shm.inference.outcome import assembled, posterior_of
from shm.inference.priors import DECADES, reading_of
from shm.inference.problem import Problem
from shm.inference.search import WarmStart, search, warm_start_from
from shm.inference.tmcmc import sample, textbook
from shm.models import THESIS, AsMade, Model
from shm.values import ENOUGH_EFFECTIVE, NAN, ModalTest, Posterior, Selection

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
