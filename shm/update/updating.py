"""Posterior of one model class, and the choice among several, given modal tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from shm.errors import UsageError
from shm.models import Model
from shm.update.importance import Weighted, weigh
from shm.update.likelihood import Measured, log_likelihood, measured, predicted_hz
from shm.update.problem import Points, Problem
from shm.update.tmcmc import Normal, move, normalised, sample, systematic
from shm.values import (
    PLANES,
    FloatArray,
    ModalTest,
    Posterior,
    PredictedFrequency,
    Selection,
)

Progress = Callable[[str, float], None]

_RUNS = 4
_FINAL_MOVES = 5
_ENOUGH = 0.5


def _silent(label: str, fraction: float) -> None:
    """No progress is shown."""


@dataclass(frozen=True)
class UpdateOptions:
    """How to update: posterior samples to keep, seed, and how often the data set counts (N_D)."""

    samples: int = 1000
    seed: int = 1
    repeat: int = 1


def update(
    tests: Sequence[ModalTest],
    model: Model,
    options: UpdateOptions | None = None,
    progress: Progress = _silent,
) -> Posterior:
    """The posterior of `model` given all modes of `tests`.

    Independent runs of the sampler find the posterior (their agreement is `r_hat`), importance
    sampling gives the evidence and the draws, and a few moves spread equal draws. `progress`
    hears the model's name and the fraction done. Raises BadInput where a test has no modes or
    conditions that the model class cannot describe.
    """
    options = options or UpdateOptions()
    started = time.perf_counter()
    for test in tests:
        model.refuse(test)
    problem = Problem(model, measured(tests, options.repeat))
    rng = np.random.default_rng(options.seed)
    runs = _independent_runs(problem, options.samples, rng, progress)
    population = np.vstack([run.z for run in runs])
    weighted = weigh(problem, population, _ENOUGH * options.samples, rng)
    theta = problem.theta(_draws(problem, weighted, Normal.of(population), options.samples, rng))
    progress(model.name, 1.0)
    likelihood = _log_likelihood(problem, theta)
    return Posterior(
        model=model.name,
        hanger=tests[0].hanger,
        names=problem.names,
        samples=theta,
        log_likelihood=likelihood,
        most_probable=_most_probable(problem, theta[int(likelihood.argmax())]),
        nominal_tension_n=model.hanger.nominal_tension_n,
        log_evidence=weighted.log_evidence,
        log_evidence_sd=weighted.log_evidence_sd,
        effective_sample_size=min(weighted.effective_sample_size, options.samples),
        r_hat=r_hat([run.z for run in runs]),
        evaluations=problem.evaluations,
        predicted=_predicted(problem, theta),
        tests=tuple(test.id for test in tests),
        seed=options.seed,
        seconds=time.perf_counter() - started,
    )


def _independent_runs(
    problem: Problem, samples: int, rng: np.random.Generator, progress: Progress
) -> list[Points]:
    runs = []
    for run in range(_RUNS):
        progress(problem.model.name, run / (_RUNS + 1))
        runs.append(sample(problem, max(samples // _RUNS, 10 * problem.dimension), rng))
    progress(problem.model.name, _RUNS / (_RUNS + 1))
    return runs


def _draws(
    problem: Problem, weighted: Weighted, centre: Normal, n: int, rng: np.random.Generator
) -> FloatArray:
    """Equally weighted posterior points (n, d): resampled, moved apart, unfolded."""
    weights = normalised(weighted.log_weights)
    points = weighted.points.take(systematic(weights, n, rng))
    moved, _ = move(problem, points, 0.0, centre, 0.5, _FINAL_MOVES, rng)
    return rng.permutation(problem.unfold(moved.z, rng))


def r_hat(runs: Sequence[FloatArray]) -> float:
    """Gelman and Rubin's (1992) potential scale reduction over runs of shape (n, d), the worst."""
    within = np.mean([run.var(axis=0, ddof=1) for run in runs], axis=0)
    between = np.var([run.mean(axis=0) for run in runs], axis=0, ddof=1)
    return float(np.sqrt(1 + between / within).max())


def _log_likelihood(problem: Problem, theta: FloatArray) -> FloatArray:
    predicted = predicted_hz(problem.model, theta[:, :-1], problem.data)
    return log_likelihood(predicted, theta[:, -1], problem.data)


def _most_probable(problem: Problem, start: FloatArray) -> FloatArray:
    """The parameter set (d,) of largest posterior density, climbed to from the best draw."""
    width = problem.upper - problem.lower
    low, high = problem.lower.copy(), problem.upper
    low[-1] = 1e-9

    def cost(fraction: FloatArray) -> float:
        return -float(_log_likelihood(problem, (low + fraction * width).clip(low, high)[None])[0])

    climbed = minimize(
        cost, (start - low) / width, method="Nelder-Mead", bounds=[(0, 1)] * len(low)
    )
    return np.asarray((low + climbed.x * width).clip(low, high))


def _predicted(problem: Problem, theta: FloatArray) -> tuple[PredictedFrequency, ...]:
    """Mean and standard deviation of each measured frequency's prediction, thesis (4.14)."""
    data: Measured = problem.data
    predicted = predicted_hz(problem.model, theta[:, :-1], data)
    rows = zip(data.plane, data.order, predicted.T, data.frequency_hz, strict=True)
    return tuple(
        PredictedFrequency(
            plane=PLANES[plane],
            order=int(order) + 1,
            mean_hz=float(samples.mean()),
            sd_hz=float(samples.std(ddof=1)),
            measured_hz=float(frequency),
        )
        for plane, order, samples, frequency in rows
    )


def select(
    tests: Sequence[ModalTest],
    models: Sequence[Model],
    options: UpdateOptions | None = None,
    progress: Progress = _silent,
) -> Selection:
    """The posteriors of all `models`, most probable first, the models equally probable before.

    Thesis (4.15) to (4.17). Raises UsageError where no model is given, BadInput as `update` does.
    """
    if not models:
        raise UsageError("no model class to select from.", remedy="Name at least one.")
    posteriors = [update(tests, model, options, progress) for model in models]
    posteriors.sort(key=lambda posterior: -posterior.log_evidence)
    weights = normalised(np.array([posterior.log_evidence for posterior in posteriors]))
    return Selection(tuple(posteriors), tuple(float(weight) for weight in weights))
