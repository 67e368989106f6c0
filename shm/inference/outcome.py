"""What a sampler found, made into the posterior that others see."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from shm.inference.importance import Weighted
from shm.inference.likelihood import Likelihood
from shm.inference.mixture import Normal
from shm.inference.options import UpdateOptions
from shm.inference.problem import Problem
from shm.inference.tmcmc import Mover
from shm.values import FloatArray, ModalTest, Posterior, PredictedFrequency

SIGMA = "sigma"
_FINAL_STEPS = 5
_DIFFERENCE = 1e-6


@dataclass(frozen=True, eq=False)
class Outcome:
    """Equal draws with sigma, `samples` (n, d + 1), what they predict (n, measurements), evidence.

    `method` is the way they were sampled.
    """

    samples: FloatArray
    predicted: FloatArray
    log_evidence: float
    log_evidence_sd: float
    effective_sample_size: float
    r_hat: float
    method: str


def posterior_of(
    problem: Problem,
    weighted: Weighted,
    tests: Sequence[ModalTest],
    options: UpdateOptions,
    rng: np.random.Generator,
    started: float,
    method: str = "tmcmc",
) -> Posterior:
    """The posterior that weighted draws make; `started` is the clock's reading at the begin."""
    samples, predicted = _draws(problem, weighted, options.samples, rng)
    outcome = Outcome(
        samples,
        predicted,
        weighted.log_evidence,
        weighted.log_evidence_sd,
        min(weighted.effective_sample_size, options.samples),
        weighted.r_hat,
        method,
    )
    return assembled(problem, outcome, tests, options, started)


def assembled(
    problem: Problem,
    outcome: Outcome,
    tests: Sequence[ModalTest],
    options: UpdateOptions,
    started: float,
) -> Posterior:
    """The posterior of equal draws."""
    model, samples = problem.model, outcome.samples
    log_likelihood = problem.likelihood.joint(outcome.predicted, samples[:, -1])
    return Posterior(
        model=model.name,
        hanger=tests[0].hanger,
        names=(*problem.prior.names, SIGMA),
        samples=samples,
        log_likelihood=log_likelihood,
        most_probable=_most_probable(problem, samples[int(log_likelihood.argmax())]),
        nominal_tension_n=model.hanger.nominal_tension_n,
        log_evidence=outcome.log_evidence,
        log_evidence_sd=outcome.log_evidence_sd,
        effective_sample_size=outcome.effective_sample_size,
        r_hat=outcome.r_hat,
        evaluations=problem.evaluations,
        predicted=_predicted(problem.likelihood, outcome.predicted),
        tests=tuple(test.id for test in tests),
        seed=options.seed,
        seconds=time.perf_counter() - started,
        method=outcome.method,
    )


def _draws(
    problem: Problem, weighted: Weighted, n: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Posterior samples with sigma (n, d + 1) and what they predict (n, measurements)."""
    points = weighted.resampled(n, rng)
    points = Mover(problem, 0.0, Normal.of(points.z), step=0.5).walk(points, _FINAL_STEPS, rng)
    points = points.take(rng.permutation(n))
    sigma = problem.likelihood.draw_sigma(points.predicted, rng)
    theta = problem.coordinates.unfold(problem.coordinates.theta(points.z), rng)
    return np.column_stack([theta, sigma]), points.predicted


def _most_probable(problem: Problem, best: FloatArray) -> FloatArray:
    """The parameter set with sigma (d + 1,) of largest density, climbed to from the best sample.

    The priors are uniform, so that at given sigma the climb is a bounded least-squares fit.
    """
    likelihood, prior = problem.likelihood, problem.prior
    width = prior.upper - prior.lower
    noise = np.hypot(best[-1], likelihood.identification_error)

    def scaled_misfit(shares: FloatArray) -> FloatArray:
        theta = prior.lower + width * np.atleast_2d(shares)
        return np.asarray(likelihood.misfit(problem.run(theta)) / noise)

    def one(shares: FloatArray) -> FloatArray:
        return np.asarray(scaled_misfit(shares)[0])

    def slopes(shares: FloatArray) -> FloatArray:
        steps = np.where(shares < 0.5, _DIFFERENCE, -_DIFFERENCE)
        misfits = scaled_misfit(np.vstack([shares, shares + np.diag(steps)]))
        return np.asarray(((misfits[1:] - misfits[0]) / steps[:, None]).T)

    start = ((best[:-1] - prior.lower) / width).clip(0, 1)
    fit = least_squares(one, start, slopes, bounds=(0, 1), max_nfev=30)
    theta = prior.lower + width * fit.x
    climbed = np.append(theta, likelihood.likeliest_sigma(problem.run(theta[None])))
    candidates = np.array([best, np.append(theta, best[-1]), climbed])
    predicted = problem.run(candidates[:, :-1])
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
