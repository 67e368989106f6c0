"""Posterior of one model class, and the choice among several.

Climbs from dispersed starts find the peaks, and the sampler goes on from these
(`shm.inference.sampler.sampling`). `Posterior.method` states how. A known posterior gives further
starts and nothing else: prior, likelihood and answer are the same.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.inference.answer.other_answers import reading_off_sd
from shm.inference.answer.outcome import posterior_of
from shm.inference.options import Progress, UpdateOptions, silent
from shm.inference.problem.data_checks import check_for_update
from shm.inference.problem.field import FieldLikelihood
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.priors import clamped_probability, reading_of
from shm.inference.problem.shapes import SHAPES
from shm.inference.problem.starts import find_starts, known_places
from shm.inference.sampler.density import find_peaks
from shm.inference.sampler.mixture import normalised
from shm.inference.sampler.sampling import Sampled, sample
from shm.models import THESIS, AsMade, Model
from shm.values import NAN, ModalTest, Posterior, Selection

_DRAWS_WITHOUT_READING = 1000  # for the quartiles


def update(
    tests: Sequence[ModalTest],
    model: Model,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
    warm_start: Posterior | None = None,
) -> Posterior:
    """Return the posterior of `model` given all modes of `tests`.

    `warm_start`, a posterior on the same or earlier tests, also of another class, gives further
    starts and changes nothing else. `progress` hears the model's name and the fraction done. Raises
    BadInput where a test has no modes or conditions that the model class cannot describe.
    """
    options = options or UpdateOptions()
    tests, checked = check_for_update(tests, model)
    problem = Problem.of(tests, model, progress, options.calibration)
    started = time.perf_counter()
    rng = np.random.default_rng(options.seed)
    progress(model.name, 0.0)
    inferred = infer(problem, options, rng, progress, warm_start)
    progress(model.name, 1.0)
    found = posterior_of(problem, inferred, tests, options, rng, started)
    found = replace(found, reading_off_sd=_off_the_reading(tests, model, options, rng), **checked)
    return replace(found, remarks=(*found.remarks, *_remarks_on_shapes(problem, inferred)))


def refresh(
    tests: Sequence[ModalTest],
    model: Model,
    known: Posterior,
    options: UpdateOptions | None = None,
    progress: Progress = silent,
) -> Posterior:
    """Return the posterior of `model` given `tests` alone, started from a `known` one.

    The same seed, tests and known posterior give the same draws. Raises UsageError where the known
    posterior is of another class, BadInput as `update` does.
    """
    if known.model != model.name:
        raise UsageError(
            f"a known posterior of model class {known.model} says nothing about {model.name}.",
            remedy="Give one of the same class, or use `update`.",
        )
    return update(tests, model, options, progress, known)


def infer(
    problem: Problem,
    options: UpdateOptions,
    rng: np.random.Generator,
    progress: Progress = silent,
    known: Posterior | None = None,
) -> Sampled:
    """Return draws of the posterior of any `problem`, and its evidence.

    Where fewer than 200 are effective, emcee continues.
    """
    centres = known_places(problem, known, rng) if known is not None else None
    rough = problem.rough
    peaks = find_peaks(rough, find_starts(rough, rng, centres))
    # The noise near the peak, which may move it.
    problem.settle(peaks[0].z)
    peaks = find_peaks(rough, np.array([peak.z for peak in peaks]))
    name = problem.model.name
    progress(name, 0.3)
    return sample(
        problem,
        peaks,
        options.samples,
        rng,
        options.sampler,
        centres,
        lambda done: progress(name, 0.3 + 0.5 * done),
    )


def _remarks_on_shapes(problem: Problem, inferred: Sampled) -> tuple[str, ...]:
    """Return a remark where no bar that has the frequencies has the mode shapes."""
    likelihood = problem.measured
    if not isinstance(likelihood, FieldLikelihood) or not likelihood.shapes.size:
        return ()
    misfits = inferred.points.predicted[:, -likelihood.shapes.size :]
    if likelihood.shapes.gross_probability(misfits) < SHAPES.rather_gross:
        return ()
    return (
        "The mode shapes contradict the frequencies and hardly count. Check the place, the plane "
        "and the sign of each sensor.",
    )


def _off_the_reading(
    tests: Sequence[ModalTest], model: Model, options: UpdateOptions, rng: np.random.Generator
) -> float:
    """Return by how many sd a reading differs from the frequencies' own, NaN without one."""
    reading = reading_of(tests, model.hanger.assumptions)
    if reading is None or model.priors == THESIS:
        return NAN
    unread = [replace(each, tension_read_n=NAN, tension_read_sd_n=NAN) for each in tests]
    problem = Problem.of(unread, model, silent, options.calibration)
    fewer = replace(options, samples=_DRAWS_WITHOUT_READING)
    theta = problem.coordinates.finished(infer(problem, fewer, rng).points.z, rng)
    return reading_off_sd(np.log(theta[:, 0]), reading, model.hanger.nominal_tension_n)


def select(
    tests: Sequence[ModalTest],
    models: Sequence[Model],
    options: UpdateOptions | None = None,
    progress: Progress = silent,
    class_priors: Mapping[str, float] | None = None,
) -> Selection:
    """Return the posteriors of all `models`, the most probable first.

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
        check_class_priors(class_priors, [model.name for model in models])
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
    """Return the probability of each class, by name, given the evidences and before any data."""
    if class_priors is None:
        prior = {model.name: log_class_prior(model) for model in models}
    else:
        prior = {name: float(np.log(stated)) for name, stated in class_priors.items()}
    log = np.array([each.log_evidence + prior[each.model] for each in posteriors])
    weights = normalised(log)
    return {each.model: float(w) for each, w in zip(posteriors, weights, strict=True)}


def check_class_priors(class_priors: Mapping[str, float], names: Sequence[str]) -> None:
    """Raise UsageError where a class compared has no prior above 0, or another class has one."""
    odd = [
        f"A prior of {name} is given, but {name} is not compared."
        for name in class_priors
        if name not in names
    ]
    lacking = [name for name in names if name not in class_priors]
    if lacking:
        odd.append(f"No prior of {', '.join(lacking)}: give one of each class compared.")
    odd += [
        f"A prior of {stated:g} of {name} is not above 0."
        for name, stated in class_priors.items()
        if name in names and not 0 < stated < math.inf
    ]
    if odd:
        raise UsageError(
            " ".join(odd), remedy=f"Give priors of {', '.join(names)}, or none at all."
        )


def log_class_prior(model: Model) -> float:
    """Return the log of how probable a class is beforehand, next to one with end springs."""
    if not isinstance(model, AsMade) or model.springs:
        return 0.0
    clamped = clamped_probability(model.hanger.end_kind, model.hanger.assumptions)
    return math.log(clamped / (1 - clamped))
