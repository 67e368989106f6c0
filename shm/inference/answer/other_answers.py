"""Find other answers that the data allow, and contradictions that no posterior alone shows.

Orders that fit as well, a description that only holds if several tolerances are exceeded, a reading
that the frequencies contradict: none of these widens its interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from shm.inference.problem.described import DescribedCoordinates
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.priors import TensionReading
from shm.inference.sampler.density import climb
from shm.values import NAN, FloatArray
from shm.values.posterior import NO_TENSION_PERCENT

_AS_WELL = 1.0
"""A fit that is worse by less in its log likelihood is as good (judgement)."""

_SEEN = 0.2
"""Judgement: of 200 draws that see no more, the error of their mean would count twofold."""

_STARTS = (-1.0, 0.0, 1.0)
"""Scores of the ends at the start of a fit with other orders."""
_STEPS = 15


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


def other_answers(problem: Problem, outcome: Outcome) -> dict[str, Any]:
    """Return fields of a `Posterior` that its draws do not show, of a bar as made."""
    coordinates = problem.coordinates
    if not isinstance(coordinates, DescribedCoordinates):
        return {}
    z = coordinates.places(outcome.samples[:, :-1])
    off_sd = {"description_off_sd": _description_off_sd(coordinates.seen_deviates(z))}
    if not coordinates.ends.felt:
        return off_sd
    fits = _fits(problem, z)
    return {
        **off_sd,
        "tension_of_other_orders_n": _tension_of_other_orders_n(
            problem, z[fits.argmax()], float(fits.max()), outcome.samples[:, 0]
        ),
    }


def _fits(problem: Problem, z: FloatArray) -> FloatArray:
    """Return the log likelihood (n,) at `z` (n, d), less half of the square of what the description
    is asked to be off by: all scores but those of tension and ends.
    """
    likelihood = problem.measured.marginal(problem.predict(z))
    asked = problem.coordinates.asked_of_description(z)  # type: ignore[union-attr]
    fits = likelihood - 0.5 * (asked**2).sum(axis=1)
    return np.asarray(np.nan_to_num(fits, nan=-np.inf))


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


def _tension_of_other_orders_n(
    problem: Problem,
    best: FloatArray,
    fit: float,
    ratio: FloatArray,
) -> float:
    """Return the tension if all orders were one higher, or one lower, where that fits as well as
    the `best` point (d,) and lies nearer to the nominal tension than `ratio` (draws,), theta_F; NaN
    where it does not.

    A series that begins with the first order has no such twin unless it is short; one of a few
    higher orders nearly always has, and then only the nominal tension tells which is right.
    """
    coordinates, nominal_n = problem.coordinates, problem.model.hanger.nominal_tension_n
    theta = coordinates.theta(best[None])
    middle = float(np.mean([mode.order for mode in problem.measured.modes]))
    nearest, found = abs(math.log(float(np.median(ratio)))), NAN
    for by in (1, -1):
        other = problem.rough.renumbered(by, theta[0])
        if other is None:
            continue
        start = theta.copy()
        start[0, 0] *= (middle / (middle + by)) ** 2
        starts = coordinates.places(start).repeat(len(_STARTS), axis=0)
        starts[:, coordinates.ends_at] = np.array(_STARTS)[:, None]  # type: ignore[union-attr]
        ends, _ = climb(other, starts, steps=_STEPS)
        fits = _fits(other, ends)
        end = ends[[fits.argmax()]]
        theta_f = float(coordinates.theta(end)[0, 0])
        if misfit_percent(other, other.predict(end)) > NO_TENSION_PERCENT:
            continue
        if fits.max() > fit - _AS_WELL and abs(math.log(theta_f)) < nearest:
            nearest, found = abs(math.log(theta_f)), theta_f * nominal_n
    return found


def misfit_percent(problem: Problem, predicted: FloatArray) -> float:
    """Return by how much mean predictions (n, data) miss the frequencies, root mean square."""
    found = problem.measured.explained(predicted).mean(axis=0)
    off = found / problem.measured.frequency_hz[: len(found)] - 1
    return float(100 * np.sqrt(np.mean(off**2)))


def reading_off_sd(log_tension: FloatArray, reading: TensionReading, nominal_n: float) -> float:
    """By how many standard deviations a tension that was read is off what frequencies alone say.

    `log_tension` (draws,) is ln theta_F by these. Their quartiles stand for a normal distribution:
    tails of rare ends are long, and would make any reading fit.
    """
    low, middle, high = np.quantile(log_tension, [0.25, 0.5, 0.75])
    sd = (high - low) / (2 * scipy.stats.norm.ppf(0.75))
    return float(abs(math.log(reading.tension_n / nominal_n) - middle) / math.hypot(sd, reading.sd))
