"""Make the posterior that others see of what a sampler found."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from shm.inference.answer.other_answers import Outcome, misfit_percent, other_answers
from shm.inference.answer.shares_of_variance import with_shares
from shm.inference.options import UpdateOptions
from shm.inference.problem.described import DescribedCoordinates
from shm.inference.problem.field import FieldLikelihood
from shm.inference.problem.hanger_problem import Problem
from shm.inference.sampler.density import DIFFERENCE, climb
from shm.inference.sampler.sampling import Sampled
from shm.models.one_hanger.hanger_model import TENSION
from shm.values import FloatArray, ModalTest, Posterior, PredictedFrequency

SIGMA = "sigma"

# Forward difference: root of the 1e-12 to which frequencies are exact (docs/trials/validation.md).
_FORWARD, _MOST_ROUNDS = 1e-6, 30

_EDGE, _MANY = 0.02, 5.0
"""A parameter is at its bound where the outermost 2 % of its range hold five times the draws that
a posterior as flat as the prior puts there."""


def posterior_of(
    problem: Problem,
    inferred: Sampled,
    tests: Sequence[ModalTest],
    options: UpdateOptions,
    rng: np.random.Generator,
    started: float,
) -> Posterior:
    """Return the posterior that equal draws make; `started` is the clock's reading at the begin."""
    points = inferred.points
    sigma = problem.measured.draw_sigma(points.predicted, rng)
    theta = problem.coordinates.finished(points.z, rng)
    outcome = Outcome(
        np.column_stack([theta, sigma]),
        points.predicted,
        inferred.log_evidence,
        inferred.log_evidence_sd,
        inferred.effective_sample_size,
        inferred.r_hat,
        inferred.method,
    )
    found = assembled(problem, outcome, tests, options, started)
    found = with_shares(problem, found)
    return replace(found, **other_answers(problem, outcome))


def assembled(
    problem: Problem,
    outcome: Outcome,
    tests: Sequence[ModalTest],
    options: UpdateOptions,
    started: float,
) -> Posterior:
    """The posterior of equal draws."""
    model, samples = problem.model, outcome.samples
    likelihood = problem.measured
    log_likelihood = likelihood.joint(outcome.predicted, samples[:, -1])
    most_probable = _most_probable(problem, samples, log_likelihood)
    log_occam = outcome.log_evidence - float(likelihood.marginal(outcome.predicted).max())
    if isinstance(likelihood, FieldLikelihood):
        # What is kept can be computed again from the posterior alone.
        likelihood.settle(model, most_probable[:-1])
        log_likelihood = likelihood.joint(outcome.predicted, samples[:, -1])
    return Posterior(
        model=model.name,
        hanger=tests[0].hanger,
        names=(*problem.prior.names, SIGMA),
        units=(*(model.units.get(name, "") for name in problem.prior.names), "1"),
        samples=samples,
        log_likelihood=log_likelihood,
        most_probable=most_probable,
        nominal_tension_n=model.hanger.nominal_tension_n,
        log_evidence=outcome.log_evidence,
        log_evidence_sd=outcome.log_evidence_sd,
        effective_sample_size=outcome.effective_sample_size,
        r_hat=outcome.r_hat,
        evaluations=problem.evaluations,
        predicted=_predicted(problem, outcome.predicted),
        tests=tuple(test.id for test in tests),
        seed=options.seed,
        seconds=time.perf_counter() - started,
        method=outcome.method,
        sampler=options.sampler,
        priors=model.priors,
        repeatability_sd_n=repeatability_sd_n(problem, outcome),
        at_bounds=_at_bounds(problem, samples),
        misfit_percent=misfit_percent(problem, outcome.predicted),
        log_occam=log_occam,
    )


def _most_probable(problem: Problem, samples: FloatArray, log_likelihood: FloatArray) -> FloatArray:
    """The MAP estimate with sigma (parameters + 1,), climbed to from the likeliest sample."""
    coordinates = problem.coordinates
    if not isinstance(coordinates, DescribedCoordinates):
        return _highest_in_box(problem, samples[int(log_likelihood.argmax())])
    z = coordinates.places(samples[:, :-1])
    at = int((log_likelihood + coordinates.log_prior(coordinates.fold(z))).argmax())
    z, _ = climb(problem, z[[at]])
    theta = coordinates.theta(z)
    return np.append(theta[0], problem.measured.most_likely_sigma(problem.run(theta)))


def repeatability_sd_n(problem: Problem, outcome: Outcome) -> float:
    """Return the standard deviation, in N, with which one test tells a change of the tension.

    To first order about the middle of the draws: the identification's errors alone change between
    tests, whatever the description, the model and what repeats are off by (Gauss and Markov's
    estimate with the prior as one more datum). Where the prior holds an estimate back, it follows
    a change by a part only, and the errors count for as much more. NaN with the priors of the
    thesis.
    """
    coordinates, likelihood = problem.coordinates, problem.measured
    if not isinstance(coordinates, DescribedCoordinates):
        return math.nan
    places = coordinates.places(outcome.samples[:, :-1])
    middle = places[[int(((places - np.median(places, axis=0)) ** 2).sum(axis=1).argmin())]]
    slopes = problem.slopes(middle)[0]
    errors = np.asarray(likelihood.identification_error)
    common = np.median(outcome.samples[:, -1])
    known = likelihood.frequencies if isinstance(likelihood, FieldLikelihood) else len(errors)
    variance = np.asarray(likelihood.fit_error) ** 2
    variance[:known] += common**2
    precision = slopes.T @ (slopes / variance[:, None]) + np.eye(slopes.shape[1])
    gain = np.linalg.solve(precision, (slopes / variance[:, None]).T)[:, :known]
    step = DIFFERENCE * np.eye(slopes.shape[1])
    tension_n = coordinates.tension_n(np.vstack([middle, middle + step]))
    rise = (tension_n[1:] - tension_n[0]) / DIFFERENCE
    repeated_n = float(np.sqrt(((rise @ gain * errors[:known]) ** 2).sum()))
    column = coordinates.names.index(TENSION)
    response = float(rise @ gain @ slopes[:known, column] / rise[column])
    return repeated_n / response if response > 0 else math.nan


def _at_bounds(problem: Problem, samples: FloatArray) -> tuple[str, ...]:
    """Parameters with many more draws at an end of their prior than a flat posterior has."""
    coordinates = problem.coordinates
    if isinstance(coordinates, DescribedCoordinates):
        shares = coordinates.fractions_of_ranges(coordinates.places(samples[:, :-1]))
        names = coordinates.names
    else:
        prior = problem.prior
        shares = (samples[:, :-1] - prior.lower) / (prior.upper - prior.lower)
        names = prior.names
    outermost = np.maximum(np.mean(shares < _EDGE, axis=0), np.mean(shares > 1 - _EDGE, axis=0))
    return tuple(n for n, share in zip(names, outermost, strict=True) if share > _MANY * _EDGE)


def _highest_in_box(problem: Problem, best: FloatArray) -> FloatArray:
    """The parameter set with sigma (d + 1,) of largest density, climbed to from the best sample.

    The priors are uniform, so that at given sigma the climb is a bounded least-squares fit.
    """
    likelihood, prior = problem.measured, problem.prior
    width = prior.upper - prior.lower
    noise = np.hypot(best[-1], likelihood.identification_error)

    def scaled(shares: FloatArray) -> FloatArray:
        return np.asarray(problem.misfit_of(prior.lower + width * shares) / noise)

    start = ((best[:-1] - prior.lower) / width).clip(0, 1)
    theta = prior.lower + width * fitted(scaled, start, np.zeros_like(start), np.ones_like(start))
    climbed = np.append(theta, likelihood.most_likely_sigma(problem.run(theta[None])))
    candidates = np.array([best, np.append(theta, best[-1]), climbed])
    predicted = problem.run(candidates[:, :-1])
    return np.asarray(candidates[likelihood.joint(predicted, candidates[:, -1]).argmax()])


def fitted(
    scaled: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """Return the point (k,) within its bounds with the least squares of `scaled`, which gives the
    misfits (n, data) of points (n, k).
    """

    def one(point: FloatArray) -> FloatArray:
        return np.asarray(scaled(point[None])[0])

    def slopes(point: FloatArray) -> FloatArray:
        steps = np.where(point < 0.5, _FORWARD, -_FORWARD)
        found = scaled(np.vstack([point, point + np.diag(steps)]))
        return np.asarray(((found[1:] - found[0]) / steps[:, None]).T)

    fit = scipy.optimize.least_squares(
        one, start, slopes, bounds=(lower, upper), max_nfev=_MOST_ROUNDS
    )
    return np.asarray(fit.x)


def _predicted(problem: Problem, predicted: FloatArray) -> tuple[PredictedFrequency, ...]:
    """Mean and standard deviation of each measured frequency's prediction, thesis (4.14)."""
    likelihood = problem.measured
    return tuple(
        PredictedFrequency(
            plane=mode.plane,
            order=mode.order,
            mean_hz=float(samples.mean()),
            sd_hz=float(samples.std(ddof=1)),
            measured_hz=mode.frequency_hz,
        )
        for mode, samples in zip(likelihood.modes, likelihood.by_mode(predicted).T, strict=True)
    )
