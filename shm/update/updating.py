"""Posterior of one model class, and the choice among several, given modal tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from shm.errors import UsageError
from shm.models import Model
from shm.update.importance import Weighted, weigh
from shm.update.likelihood import Likelihood
from shm.update.mixture import Normal
from shm.update.problem import Problem
from shm.update.search import Anchors, search
from shm.update.tmcmc import Mover, Population, normalised, sample, systematic
from shm.values import FloatArray, ModalTest, Posterior, PredictedFrequency, Selection

Progress = Callable[[str, float], None]

SIGMA = "sigma"
_RUNS = 4
_FEWEST_PARTICLES = 100
_FINAL_STEPS = 5
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

    Independent runs of the sampler find the posterior, importance sampling gives the evidence and
    the draws (`r_hat` is the agreement of its batches), and a few steps spread equal draws.
    `progress` hears the model's name and the fraction done. Raises BadInput where a test has no
    modes or conditions that the model class cannot describe.
    """
    options = options or UpdateOptions()
    started = time.perf_counter()
    for test in tests:
        model.refuse(test)
    problem = Problem(model, Likelihood(tests, options.repeat))
    rng = np.random.default_rng(options.seed)
    progress(model.name, 0.0)
    anchors = search(problem, rng)
    runs = _independent_runs(problem, anchors, options.samples, rng, progress)
    pooled = _pooled(runs, rng)
    weighted = weigh(problem, pooled, anchors, _ENOUGH * options.samples, rng)
    samples, predicted = _draws(problem, weighted, options.samples, rng)
    log_likelihood = problem.likelihood.joint(predicted, samples[:, -1])
    progress(model.name, 1.0)
    return Posterior(
        model=model.name,
        hanger=tests[0].hanger,
        names=(*problem.prior.names, SIGMA),
        samples=samples,
        log_likelihood=log_likelihood,
        most_probable=_most_probable(problem, samples[int(log_likelihood.argmax())]),
        nominal_tension_n=model.hanger.nominal_tension_n,
        log_evidence=weighted.log_evidence,
        log_evidence_sd=weighted.log_evidence_sd,
        effective_sample_size=min(weighted.effective_sample_size, options.samples),
        r_hat=weighted.r_hat,
        evaluations=problem.evaluations,
        predicted=_predicted(problem.likelihood, predicted),
        tests=tuple(test.id for test in tests),
        seed=options.seed,
        seconds=time.perf_counter() - started,
    )


def _independent_runs(
    problem: Problem, anchors: Anchors, samples: int, rng: np.random.Generator, progress: Progress
) -> list[Population]:
    runs = []
    for done in range(1, _RUNS + 1):
        runs.append(sample(problem, anchors, max(samples // _RUNS, _FEWEST_PARTICLES), rng))
        progress(problem.model.name, done / (_RUNS + 1))
    return runs


def _pooled(runs: Sequence[Population], rng: np.random.Generator) -> FloatArray:
    """Points (n, d) of all runs, each by its evidence: one that missed counts less."""
    weights = normalised(np.array([run.log_evidence for run in runs]))
    n = sum(len(run.points.z) for run in runs)
    chosen = [
        run.points.z[systematic(np.ones(len(run.points.z)) / len(run.points.z), k, rng)]
        for run, k in zip(runs, rng.multinomial(n, weights), strict=True)
    ]
    return np.vstack(chosen)


def _draws(
    problem: Problem, weighted: Weighted, n: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Posterior samples with sigma (n, d + 1) and what they predict (n, measurements)."""
    points = weighted.resampled(n, rng)
    points = Mover(problem, 0.0, Normal.of(points.z), step=0.5).walk(points, _FINAL_STEPS, rng)
    points = points.take(rng.permutation(n))
    sigma = problem.likelihood.draw_sigma(points.predicted, rng)
    theta = problem.theta(problem.unfold(points.z, rng))
    return np.column_stack([theta, sigma]), points.predicted


def _most_probable(problem: Problem, best: FloatArray) -> FloatArray:
    """The parameter set with sigma (d + 1,) of largest density, climbed to from the best sample.

    The priors are uniform, so that at given sigma the climb is a bounded least-squares fit.
    """
    likelihood = problem.likelihood

    def predict(theta: FloatArray) -> FloatArray:
        return likelihood.predict(problem.model, theta[None])

    def scaled_misfit(theta: FloatArray) -> FloatArray:
        noise = np.hypot(best[-1], likelihood.identification_error)
        return np.asarray(likelihood.misfit(predict(theta))[0] / noise)

    fit = least_squares(
        scaled_misfit,
        best[:-1].clip(problem.prior.lower, problem.prior.upper),
        bounds=(problem.prior.lower, problem.prior.upper),
        x_scale=problem.prior.upper - problem.prior.lower,
        max_nfev=30,
    )
    climbed = np.append(fit.x, likelihood.likeliest_sigma(predict(fit.x)))
    candidates = np.array([best, np.append(fit.x, best[-1]), climbed])
    predicted = likelihood.predict(problem.model, candidates[:, :-1])
    return np.asarray(candidates[likelihood.joint(predicted, candidates[:, -1]).argmax()])


def _predicted(likelihood: Likelihood, predicted: FloatArray) -> tuple[PredictedFrequency, ...]:
    """Mean and standard deviation of each measured frequency's prediction, thesis (4.14)."""
    return tuple(
        PredictedFrequency(
            plane=mode.plane,
            order=mode.order,
            mean_hz=float(samples.mean()),
            sd_hz=float(samples.std(ddof=1)),
            measured_hz=mode.frequency_hz,
        )
        for mode, samples in zip(likelihood.modes, predicted.T, strict=True)
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
