"""What else the data allow, or what speaks against all of it, which no posterior alone shows.

Its interval weighs by the prior. Ends or orders that fit as well but that the prior makes rare, a
description that only holds if several tolerances are exceeded, a reading that the frequencies
contradict: none of these widens it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from shm.inference.described import DescribedCoordinates
from shm.inference.priors import TensionReading
from shm.inference.problem import Problem
from shm.values import FloatArray, ModalTest

_DIFFERENCE, _MOST_ROUNDS = 1e-6, 30

_ALIKE = 10.0 ** np.arange(-0.5, 2.1, 0.5)
"""k L/EI of ends that are all alike, from nearly pins to nearly clamped: on bars of
`tests/benchmarks/round_ends.py` steps half as wide find nothing more."""

_AS_WELL = 1.0
"""A fit that is worse by less in its log likelihood is as good. The 90 % interval of a normal
posterior reaches to 1.35: as good a fit beyond it is not its tail but another answer, which the
prior of the ends has ruled out, not the data."""

_MATERIAL = 0.1
"""Of the width of the interval, what lies farther beyond it is another answer."""

_STARTS = (0.3, 3.0, 30.0)
"""k L/EI at the start of a climb with other orders."""


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


def tension_of_other_ends_n(problem: Problem, outcome: Outcome) -> float:
    """The tension with ends all alike that fit as well as any, farthest beyond the interval.

    NaN where there is none. Frequencies tell springs from tension worst where all ends turn softly
    and alike, which are few among all pairs of ends.
    """
    coordinates = problem.coordinates
    if not isinstance(coordinates, DescribedCoordinates) or not coordinates.felt_springs:
        return math.nan
    place, sigma, fit = _best(problem, coordinates, outcome)
    found = [
        climbed(problem, coordinates, place, sigma, coordinates.springs_alike(alike))
        for alike in _ALIKE
    ]
    others = np.array([theta for theta, _ in found])
    fits = _fits(problem, found)
    as_well = fits > max(fit, fits.max()) - _AS_WELL
    nominal_n = problem.model.hanger.nominal_tension_n
    low, high = np.quantile(outcome.samples[:, 0] * nominal_n, [0.05, 0.95])
    tension_n = others[as_well, 0] * nominal_n
    away = np.maximum(low - tension_n, tension_n - high)
    if not (away > _MATERIAL * (high - low)).any():
        return math.nan
    return float(tension_n[away.argmax()])


def tension_of_other_orders_n(
    problem: Problem, outcome: Outcome, tests: Sequence[ModalTest]
) -> float:
    """The tension if all orders were one higher, or one lower, where that fits as well and lies
    nearer to the nominal tension; NaN where it does not.

    A series that begins with the first order has no such twin unless it is short; one of a few
    higher orders nearly always has, and then only the nominal tension tells which is right.
    """
    coordinates = problem.coordinates
    if not isinstance(coordinates, DescribedCoordinates) or not coordinates.felt_springs:
        return math.nan
    place, sigma, fit = _best(problem, coordinates, outcome)
    theta = coordinates.theta(place[None])[0]
    nearest, found = abs(math.log(float(np.median(outcome.samples[:, 0])))), math.nan
    for by in (1, -1):
        renumbered = _renumbered(tests, by)
        if renumbered is None:
            continue
        other = Problem.of(renumbered, problem.model, 1, lambda *_: None, problem.calibration)
        middle = float(np.mean([mode.order for test in tests for mode in test.regular_modes]))
        start = theta.copy()
        start[0] *= (middle / (middle + by)) ** 2
        climbs = []
        for restraint in _STARTS:
            for name, value in coordinates.springs_alike(restraint).items():
                start[coordinates.names.index(name)] = value
            begin = coordinates.places(start[None])[0]
            climbs.append(climbed(other, coordinates, begin, sigma))
        likeliest = climbs[int(_fits(other, climbs).argmax())][0]
        other.settle(coordinates.places(likeliest[None])[0])
        fits = _fits(other, climbs)
        ratio = float(climbs[int(fits.argmax())][0][0])
        if fits.max() > fit - _AS_WELL and abs(math.log(ratio)) < nearest:
            nearest, found = abs(math.log(ratio)), ratio * problem.model.hanger.nominal_tension_n
    return found


def description_off_sd(problem: Problem, outcome: Outcome) -> float:
    """By how many of its standard deviations the description is off, as far as frequencies see it:
    the norm of the mean deviates. NaN with the priors of the thesis.
    """
    coordinates = problem.coordinates
    if not isinstance(coordinates, DescribedCoordinates):
        return math.nan
    _, seen = coordinates.smooth(coordinates.places(outcome.samples[:, :-1]))
    return float(np.linalg.norm(seen.mean(axis=0)))


def reading_off_sd(log_tension: FloatArray, reading: TensionReading, nominal_n: float) -> float:
    """By how many standard deviations a tension that was read is off what frequencies alone say.

    `log_tension` (draws,) is ln theta_F by these. Their quartiles stand for a normal distribution:
    tails of rare ends are long, and would make any reading fit.
    """
    low, middle, high = np.quantile(log_tension, [0.25, 0.5, 0.75])
    sd = (high - low) / (2 * stats.norm.ppf(0.75))
    return float(abs(math.log(reading.tension_n / nominal_n) - middle) / math.hypot(sd, reading.sd))


def _best(
    problem: Problem, coordinates: DescribedCoordinates, outcome: Outcome
) -> tuple[FloatArray, float, float]:
    """The place (d,) of the draw that fits best, its sigma, and its log likelihood less half of the
    square of its deviates."""
    places = coordinates.places(outcome.samples[:, :-1])
    _, seen = coordinates.smooth(places)
    fit = problem.likelihood.marginal(outcome.predicted) - 0.5 * (seen**2).sum(axis=1)
    best = int(fit.argmax())
    return places[best], float(outcome.samples[best, -1]), float(fit[best])


def _fits(problem: Problem, climbs: Sequence[tuple[FloatArray, float]]) -> FloatArray:
    """The same of climbs."""
    predicted = problem.run(np.array([theta for theta, _ in climbs]))
    squares = np.array([square for _, square in climbs])
    return np.asarray(problem.likelihood.marginal(predicted) - 0.5 * squares)


def _renumbered(tests: Sequence[ModalTest], by: int) -> tuple[ModalTest, ...] | None:
    """The tests with every order changed; None where one would fall below 1."""
    if min(mode.order for test in tests for mode in test.regular_modes) + by < 1:
        return None
    return tuple(
        replace(test, modes=tuple(replace(mode, order=mode.order + by) for mode in test.modes))
        for test in tests
    )


def climbed(
    problem: Problem,
    coordinates: DescribedCoordinates,
    place: FloatArray,
    sigma: float,
    fixed: Mapping[str, float] | None = None,
) -> tuple[FloatArray, float]:
    """The parameters (parameters,) that fit best near `place` (d,), and the square of the deviates
    of the bar that they ask for.

    Flat priors say nothing and normal ones add the squares of the deviates seen, so that the climb
    is a bounded least-squares fit with errors of `sigma` beyond those that are known. `fixed` holds
    parameters of the box where they are given.
    """
    shares, seen = (row[0] for row in coordinates.smooth(place[None]))
    box, held = coordinates.box, dict(fixed or {})
    for name, value in held.items():
        column = box.names.index(name)
        shares[column] = (value - box.lower[column]) / (box.upper[column] - box.lower[column])
    whole = np.append(shares.clip(0, 1), seen)
    count = len(shares)
    free = np.array([name not in held for name in box.names] + [True] * len(seen))
    noise = np.hypot(sigma, problem.likelihood.fit_error)

    def scaled(points: FloatArray) -> FloatArray:
        full = np.repeat(whole[None], len(points), axis=0)
        full[:, free] = points
        theta = coordinates.of_smooth(full[:, :count], full[:, count:])
        return np.hstack([problem.likelihood.misfit(problem.run(theta)) / noise, full[:, count:]])

    def one(point: FloatArray) -> FloatArray:
        return np.asarray(scaled(point[None])[0])

    def slopes(point: FloatArray) -> FloatArray:
        steps = np.where(point < 0.5, _DIFFERENCE, -_DIFFERENCE)
        found = scaled(np.vstack([point, point + np.diag(steps)]))
        return np.asarray(((found[1:] - found[0]) / steps[:, None]).T)

    lower = np.append(np.zeros(count), np.full(len(seen), -np.inf))[free]
    upper = np.append(np.ones(count), np.full(len(seen), np.inf))[free]
    fit = least_squares(one, whole[free], slopes, bounds=(lower, upper), max_nfev=_MOST_ROUNDS)
    whole[free] = fit.x
    theta = coordinates.of_smooth(whole[None, :count], whole[None, count:])[0]
    return np.asarray(theta), float((whole[count:] ** 2).sum())
