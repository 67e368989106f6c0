"""The model class that a diagnosis starts from: the one that `select` would prefer.

Where the cause that is found would be part of another class, the diagnosis goes on with that one:
that a bar shears or that its ends turn is no gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.gap.causes.search import find_starts, fit_alone, sample_alone
from shm.gap.hypotheses.contract import GapOptions, Hypothesis, Observations
from shm.gap.hypotheses.observations import observed
from shm.gap.hypotheses.problem import MOST_REPEATED, GapProblem
from shm.gap.hypotheses.target import Target
from shm.inference.answer.updating import log_class_prior
from shm.inference.options import Progress, silent
from shm.inference.sampler.density import find_peaks
from shm.inference.sampler.mixture import normalised
from shm.inference.sampler.sampling import most_likely_error
from shm.models import AS_DESCRIBED, MODELS, AsMade, applicable, check_baseline
from shm.models.classes.base import held_otherwise
from shm.values import Hanger, ModalTest

BEAMS = ("beam1", "beam2", "beam3")
_OF_NOTE = 0.02  # of the classes' probability: less moves no interval that is told


def choose_baseline(
    tests: Sequence[ModalTest],
    hanger: Hanger,
    options: GapOptions,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> GapProblem:
    """Return the problem of the baseline in `options`, else of the likeliest beam.

    Raises UsageError for a class that is no baseline of this hanger.
    """
    names = applicable(hanger, BEAMS)[0]
    if options.baseline:
        check_baseline(options.baseline, hanger)
        names = (options.baseline,)
    elif not names:
        if not held_otherwise(hanger):
            check_baseline(AS_DESCRIBED, hanger)
        names = (AS_DESCRIBED,)
    observations = place_sensors(_problem(names[-1], tests, hanger, observed(tests, hanger)))
    problems = [_problem(name, tests, hanger, observations) for name in names]
    if len(problems) == 1:
        return problems[0]
    log = []
    for each in problems:
        progress(f"baseline {each.model.name}", 0.0)
        log.append(sample_alone(each, rng).log_evidence[0] + log_class_prior(each.model))
    share = normalised(np.array(log))
    chosen = problems[int(share.argmax())]
    for of, each in zip(share.tolist(), problems, strict=True):
        if of > _OF_NOTE:
            fit_alone(each, rng, options.draws)
            chosen.rivals.append((of, each))
    return chosen


def place_sensors(problem: GapProblem) -> Observations:
    """Return the data with the sensors where they most probably are, by the hanger alone.

    Errors of places count to first order about the places in use, and three centimetres are too
    far for a shape of high order. Predictions are shifted back by what the move explains
    (`misplaced`), so that the prior of an error stays about the stated place. No sensor is moved
    where one would be farther off than a tape errs: there the hanger has a gap.
    """
    stated, count = problem.observations, problem.design.frequencies
    for _ in range(2 if len(problem.design.shape_mode) else 0):  # steps of Gauss and Newton
        target = Target(problem, Hypothesis())
        z = find_peaks(target, find_starts(problem))[0].z[None]
        error = most_likely_error(target, z)
        covariance = np.diag(error.shape) + error.shape_loads @ error.shape_loads.T
        left = np.linalg.solve(covariance, target.residual(z)[0, count:])
        size = problem.place_loads.T @ left
        if (np.abs(size) > MOST_REPEATED).any():
            return stated
        places_m = np.array(stated.design.places_m) + size * problem.hanger.scatter.sensor_place_m
        design = replace(stated.design, places_m=tuple(places_m.tolist()))
        moved = GapProblem(problem.model, problem.tests, replace(stated, design=design))
        placed = replace(moved.observations, misplaced=moved.place_loads @ size)
        problem = GapProblem(problem.model, problem.tests, placed)
    return problem.observations


def find_richer(problem: GapProblem, hypothesis: Hypothesis) -> GapProblem | None:
    """Return the problem of the beam that has most effects of a hypothesis as its own parameters.

    It has those of the beam of `problem`, too. None where no beam has any effect more.
    """
    effects, included = {name for name, _ in hypothesis.effects}, set(problem.has_itself)
    best, most = None, 0
    for name in applicable(problem.hanger, BEAMS)[0]:
        other = _problem(name, problem.tests, problem.hanger, problem.observations)
        shared = len(effects & set(other.has_itself) - included)
        if included <= set(other.has_itself) and shared > most:
            best, most = other, shared
    if best is not None:
        best.rivals = problem.rivals
    return best


def _problem(
    name: str, tests: Sequence[ModalTest], hanger: Hanger, observations: Observations
) -> GapProblem:
    return GapProblem(AsMade(MODELS[name](hanger)), tests, observations)
