"""What else the data allow, or what speaks against all of it, which no posterior alone shows.

Its interval weighs by the prior. Ends or orders that fit as well but that the prior makes rare, a
description that only holds if several tolerances are exceeded, a reading that the frequencies
contradict: none of these widens it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import scipy

from shm.inference.described import DescribedCoordinates
from shm.inference.field import FieldLikelihood
from shm.inference.options import silent
from shm.inference.priors import TensionReading
from shm.inference.problem import Problem
from shm.models.as_made import TENSION
from shm.values import NAN, FloatArray, ModalTest

# Forward difference: root of the 1e-12 to which frequencies are exact (docs/trials/validation.md).
_DIFFERENCE = 1e-6
_MOST_ROUNDS = 30  # judgement: a climb from the best draw has converged, and one that has not stops

_ALIKE = 10.0 ** np.arange(-0.5, 2.1, 0.5)
"""k L/EI of ends that are all alike, from nearly pins to nearly clamped: on bars of
`tests/benchmarks/round_ends.py` steps half as wide find nothing more."""

_FARTHER = (0.1, 0.25, 0.5, 0.7, 1.4, 2.0)
"""Of the end of the interval on that side: tensions held there tell how far the data allow any, of
a slack hanger above all."""

_AS_WELL = 1.0
"""A fit that is worse by less in its log likelihood is as good. The 90 % interval of a normal
posterior reaches to 1.35: as good a fit beyond it is not its tail but another answer, which the
prior of the ends has ruled out, not the data."""

_MATERIAL = 0.1
"""Of the width of the interval, what lies farther beyond it is another answer."""

_SEEN = 0.2
"""Judgement: of 200 draws that see no more, the error of their mean would count twofold."""

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


@dataclass(frozen=True, eq=False)
class _Best:
    """The draw that fits best: its place (d,), its sigma, and its log likelihood less half of the
    square of its deviates, `fit`."""

    place: FloatArray
    sigma: float
    fit: float


def other_answers(problem: Problem, outcome: Outcome, tests: Sequence[ModalTest]) -> dict[str, Any]:
    """Fields of a `Posterior` that its own draws do not show, of a bar as made.

    The description is off as far as frequencies see it.
    """
    coordinates = problem.coordinates
    if not isinstance(coordinates, DescribedCoordinates):
        return {}
    places = coordinates.places(outcome.samples[:, :-1])
    _, seen = coordinates.smooth(places)
    off_sd = {"description_off_sd": _description_off_sd(seen)}
    if not coordinates.felt_springs:
        return off_sd
    fit = problem.likelihood.marginal(outcome.predicted) - 0.5 * (seen**2).sum(axis=1)
    at = int(fit.argmax())
    best = _Best(places[at], float(outcome.samples[at, -1]), float(fit[at]))
    of = problem, coordinates, best, outcome.samples[:, 0]
    return {
        **off_sd,
        "tension_of_other_ends_n": _tension_of_other_ends_n(*of),
        "tension_of_other_orders_n": _tension_of_other_orders_n(*of, tests),
    }


def _description_off_sd(seen: FloatArray) -> float:
    """By how many standard deviations deviates (draws, seen) are off what a sound bar's would be.

    Beforehand their mean is expected at 0 with the variance that the data take off the prior's 1.
    Data that see little of a large error pull it little, but just as surely.
    """
    mean, left = seen.mean(axis=0), np.atleast_2d(np.cov(seen, rowvar=False))
    taken, direction = np.linalg.eigh(np.eye(len(mean)) - left)
    # Of directions that next to nothing is seen of, or with two answers, the spread says nothing.
    spread = np.where(taken > _SEEN, taken.clip(max=1.0), 1.0)
    return float(np.sqrt(((mean @ direction) ** 2 / spread).sum()))


def _tension_of_other_ends_n(
    problem: Problem, coordinates: DescribedCoordinates, best: _Best, ratio: FloatArray
) -> float:
    """The tension with ends all alike that fit as well as any, farthest beyond the interval of
    `ratio` (draws,), theta_F.

    NaN where there is none. Frequencies tell springs from tension worst where all ends turn softly
    and alike, which are few among all pairs of ends. And where few modes of a short stiff bar tell
    nearly nothing, clamped ends rule the nominal tension out that springs would allow, and the
    nominal tension a slack bar.
    """
    low, high = np.quantile(ratio, [0.05, 0.95])
    tensions = [0.0, *(math.log(of * (low if of < 1 else high)) for of in _FARTHER)]
    box = coordinates.box
    at = box.names.index(TENSION)
    held = [
        *map(coordinates.springs_alike, _ALIKE),
        *({TENSION: each} for each in tensions if box.lower[at] < each < box.upper[at]),
    ]
    found = [climbed(problem, coordinates, best.place, best.sigma, each) for each in held]
    # From tensions that were held the climb goes on to the nearest optimum.
    for theta, _ in found[len(_ALIKE) :]:
        place = coordinates.places(theta[None])[0]
        found.append(climbed(problem, coordinates, place, best.sigma))
    others = np.array([theta for theta, _ in found])
    fits = _fits(problem, found)
    as_well = fits > max(best.fit, fits.max()) - _AS_WELL
    nominal_n = problem.model.hanger.nominal_tension_n
    away = np.maximum(low - others[as_well, 0], others[as_well, 0] - high)
    if not (away > _MATERIAL * (high - low)).any():
        return NAN
    return float(others[as_well, 0][away.argmax()] * nominal_n)


def _tension_of_other_orders_n(
    problem: Problem,
    coordinates: DescribedCoordinates,
    best: _Best,
    ratio: FloatArray,
    tests: Sequence[ModalTest],
) -> float:
    """The tension if all orders were one higher, or one lower, where that fits as well and lies
    nearer to the nominal tension than `ratio` (draws,), theta_F; NaN where it does not.

    A series that begins with the first order has no such twin unless it is short; one of a few
    higher orders nearly always has, and then only the nominal tension tells which is right.
    """
    theta = coordinates.theta(best.place[None])[0]
    middle = float(np.mean([mode.order for test in tests for mode in test.regular_modes]))
    nearest, found = abs(math.log(float(np.median(ratio)))), NAN
    for by in (1, -1):
        renumbered = _renumbered(tests, by)
        if renumbered is None:
            continue
        other = Problem.of(renumbered, problem.model, silent, problem.calibration)
        start = theta.copy()
        start[0] *= (middle / (middle + by)) ** 2
        climbs = []
        for restraint in _STARTS:
            for name, value in coordinates.springs_alike(restraint).items():
                start[coordinates.names.index(name)] = value
            begin = coordinates.places(start[None])[0]
            climbs.append(climbed(other, coordinates, begin, best.sigma))
        likeliest = climbs[int(_fits(other, climbs).argmax())][0]
        other.settle(coordinates.places(likeliest[None])[0])
        fits = _fits(other, climbs)
        theta_f = float(climbs[int(fits.argmax())][0][0])
        if fits.max() > best.fit - _AS_WELL and abs(math.log(theta_f)) < nearest:
            nearest, found = (
                abs(math.log(theta_f)),
                theta_f * problem.model.hanger.nominal_tension_n,
            )
    return found


def reading_off_sd(log_tension: FloatArray, reading: TensionReading, nominal_n: float) -> float:
    """By how many standard deviations a tension that was read is off what frequencies alone say.

    `log_tension` (draws,) is ln theta_F by these. Their quartiles stand for a normal distribution:
    tails of rare ends are long, and would make any reading fit.
    """
    low, middle, high = np.quantile(log_tension, [0.25, 0.5, 0.75])
    sd = (high - low) / (2 * scipy.stats.norm.ppf(0.75))
    return float(abs(math.log(reading.tension_n / nominal_n) - middle) / math.hypot(sd, reading.sd))


def _fits(problem: Problem, climbs: Sequence[tuple[FloatArray, float]]) -> FloatArray:
    """The log likelihood (climbs,) of each, less half of the square of its deviates."""
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
    # What modes share counts together: supports give two per cent of a short thick bar.
    whitening = cast(FieldLikelihood, problem.likelihood).whitening(sigma)

    def scaled(points: FloatArray) -> FloatArray:
        full = np.repeat(whole[None], len(points), axis=0)
        full[:, free] = points
        theta = coordinates.of_smooth(full[:, :count], full[:, count:])
        misfit = problem.likelihood.misfit(problem.run(theta))
        return np.hstack([misfit @ whitening.T, full[:, count:]])

    lower = np.append(np.zeros(count), np.full(len(seen), -np.inf))[free]
    upper = np.append(np.ones(count), np.full(len(seen), np.inf))[free]
    whole[free] = fitted(scaled, whole[free], lower, upper)
    theta = coordinates.of_smooth(whole[None, :count], whole[None, count:])[0]
    return np.asarray(theta), float((whole[count:] ** 2).sum())


def fitted(
    scaled: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """The point (k,) within its bounds with the least squares of `scaled`, which gives the misfits
    (n, data) of points (n, k)."""

    def one(point: FloatArray) -> FloatArray:
        return np.asarray(scaled(point[None])[0])

    def slopes(point: FloatArray) -> FloatArray:
        steps = np.where(point < 0.5, _DIFFERENCE, -_DIFFERENCE)
        found = scaled(np.vstack([point, point + np.diag(steps)]))
        return np.asarray(((found[1:] - found[0]) / steps[:, None]).T)

    fit = scipy.optimize.least_squares(
        one, start, slopes, bounds=(lower, upper), max_nfev=_MOST_ROUNDS
    )
    return np.asarray(fit.x)
