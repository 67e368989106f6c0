"""Locate a local cause along the hanger, from the draws of its posterior."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.gap.causes.search import Attribution, Explanation
from shm.gap.hypotheses.contract import Fit
from shm.gap.hypotheses.coordinates import is_place
from shm.gap.hypotheses.problem import GapProblem
from shm.inference.sampler.likelihood import Likelihood
from shm.inference.sampler.mixture import normalised
from shm.models.effects import EFFECTS
from shm.values import FloatArray, GapPlace

_TURNING = "rotational_end_flexibility"
_STRETCHES = 60  # technical: of a profile; narrower than any local cause is long
_FEWEST = 4  # tension and stiffness take two frequencies, a size and its place two more
_LEAST_GAIN = 3.0  # of log likelihood, for a size and a place: 95 % of chance alone
_OUTSIDE = 0.05  # on either side of a 90 % interval
AS_LIKELY = 1.5
"""Places of one effect whose log evidences differ by less are not told apart."""


def places(problem: GapProblem, attribution: Attribution) -> tuple[GapPlace, ...]:
    """Return for each kind of local cause where it would have to sit; what explains most first.

    Kinds are `point mass`, `lateral spring`, `section loss` and `flexible end`, whose profile holds
    the two ends with their probabilities; absent is what was left behind by its evidence, or gains
    no more than chance would. A profile is the density of the place over all variants of the
    effect. Where two places explain the data alike, as x and L - x do of a hanger with like ends
    whose shapes were not measured, the profile has both and the interval spans both.
    """
    if problem.design.frequencies < _FEWEST:
        return ()
    found = []
    for cause in attribution.explanations:
        fits = _fits(cause)
        if cause.is_pair or not fits or cause.log_fit < _LEAST_GAIN:
            continue
        kind = EFFECTS[cause.effect].localised_as
        share = _explained(problem, attribution.baseline, fits[0][1])
        if kind:
            found.append(_along(problem, kind, fits, share))
        elif cause.effect == _TURNING:
            found.append(_at_ends(problem, fits, share))
    return tuple(sorted(found, key=lambda place: -place.share))


def _fits(cause: Explanation) -> list[tuple[float, Fit]]:
    """Return the fits of all variants, the best first, with their shares of the evidence."""
    known = [(each.log_evidence, each.posterior) for each in cause.variants]
    fitted = [(log, fit) for log, fit in known if fit is not None]
    share = normalised(np.array([log for log, _ in fitted])).tolist() if fitted else []
    return [(weight, fit) for weight, (_, fit) in zip(share, fitted, strict=True)]


def _explained(problem: GapProblem, before: Fit, after: Fit) -> float:
    """Return the share of the misfit of all data that `after` explains, by its own errors."""
    errors, common = Likelihood.of(after.noise, after.model_error), len(before.z)
    total, left = (
        errors.squares((problem.value - fit.predicted)[None])[0, 0]
        + fit.z[:common] @ fit.z[:common]
        for fit in (before, after)
    )
    return max(0.0, 1 - float(left / total))


def _along(
    problem: GapProblem, kind: str, fits: Sequence[tuple[float, Fit]], share: float
) -> GapPlace:
    length_m = problem.hanger.length_m
    x_m = np.concatenate([_place_draws_m(problem, fit) for _, fit in fits])
    weight = np.concatenate([np.full(len(fit.draws), w / len(fit.draws)) for w, fit in fits])
    density, edges_m = np.histogram(x_m, _STRETCHES, (0, length_m), weights=weight, density=True)
    order = np.argsort(x_m)
    low_m, high_m = np.interp([_OUTSIDE, 1 - _OUTSIDE], weight[order].cumsum(), x_m[order])
    main_m, _ = split_place(_place_draws_m(problem, fits[0][1]), length_m)
    profile = zip(((edges_m[1:] + edges_m[:-1]) / 2).tolist(), density.tolist(), strict=True)
    return GapPlace(kind, float(main_m.mean()), float(low_m), float(high_m), share, tuple(profile))


def _place_draws_m(problem: GapProblem, fit: Fit) -> FloatArray:
    coordinates = problem.coordinates(fit.hypothesis)
    column = next(i for i, each in enumerate(coordinates.effects) if is_place(each))
    return coordinates.effect_values(fit.draws)[:, column]


def _at_ends(problem: GapProblem, fits: Sequence[tuple[float, Fit]], share: float) -> GapPlace:
    """Return the ends that turn; a variant of both counts half for each."""
    by_end = np.zeros(2)
    for weight, fit in fits:
        ends = fit.hypothesis.effects[0][1].ends
        by_end[list(ends)] += weight / len(ends)
    x_m = np.array([0.0, problem.hanger.length_m])
    possible = x_m[by_end >= 2 * _OUTSIDE]
    best_m, low_m, high_m = (
        float(each) for each in (x_m[by_end.argmax()], possible.min(), possible.max())
    )
    profile = tuple(zip(x_m.tolist(), by_end.tolist(), strict=True))
    return GapPlace("flexible end", best_m, low_m, high_m, share, profile)


def list_other_places(problem: GapProblem, fit: Fit) -> tuple[str, ...]:
    """Return where else along the hanger a local effect is about as likely, in words."""
    coordinates = problem.coordinates(fit.hypothesis)
    values = coordinates.effect_values(fit.draws)
    found = []
    for each, column in zip(coordinates.effects, values.T, strict=True):
        if is_place(each):
            main, other = split_place(column, problem.hanger.length_m)
            if len(other) > math.exp(-AS_LIKELY) * len(main):
                found.append(f"at {other.mean():.2f} m")
    return tuple(found)


def split_place(x_m: FloatArray, length_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the draws (n,) of a place on the likelier side of mid-length, and the others.

    There are no others where the two sides run into each other: that is one place.
    """
    sides = x_m[x_m < length_m / 2], x_m[x_m >= length_m / 2]
    main, other = sorted(sides, key=len, reverse=True)
    if not len(other):
        return main, other
    (low, high), (first, last) = (np.quantile(each, [0.05, 0.95]) for each in sides)
    apart = first - high > (high - low) + (last - first)
    return (main, other) if apart else (x_m, other[:0])
