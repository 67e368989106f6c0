"""A hypothesis fitted to the observations, with its evidence by Laplace's method.

Laplace's method (Tierney and Kadane 1986) puts a normal distribution on each of the most probable
points; the evidence is the sum of their integrals. Mirror images count as what they are: two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy

from shm.errors import BadInput
from shm.gap.contract import Fit, Hypothesis, Peak
from shm.gap.coordinates import is_place
from shm.gap.detectability import scan
from shm.gap.likelihood import Likelihood
from shm.gap.objective import Landscape
from shm.gap.optimiser import Optimum, optima
from shm.gap.problem import GapProblem
from shm.values import FloatArray

_DRAWS = 256  # technical: a mean to 6 % of its sd, as the likeliest fits are sampled afterwards
# Judgement: each start costs a descent. From 3 points of a scan; and over 93 % of the prior of the
# tension one of four lies within half a standard deviation.
STARTS = 3
_BASELINE_STARTS = (-2.0, -1.0, 0.0, 1.0)
BASELINE = Hypothesis()

_POOR = 3.0
"""Squares of the residuals, per datum, from which on a fit is poor whatever the errors."""


def fitted(
    problem: GapProblem,
    hypothesis: Hypothesis,
    rng: np.random.Generator,
    starts: FloatArray | None = None,
    likelihood: Likelihood | None = None,
) -> Fit:
    """The fit of `hypothesis` from `starts` z (n, d), or from where a scan of its effects leads.

    The scan stands on the baseline's own fit, which the problem keeps. `likelihood` is the
    problem's own unless another is given. `draws` are those of the
    normal approximation. Raises BadInput where no start can be predicted.
    """
    landscape = Landscape(problem, hypothesis, likelihood)
    z = _starts(problem, hypothesis, rng) if starts is None else starts
    found = optima(landscape, z)
    if not found:
        raise BadInput(
            f"the model cannot be solved anywhere for {hypothesis.name or problem.baseline}.",
            remedy="Check the description of the hanger.",
        )
    return _fit(landscape, _seen_from_the_other_end(landscape, found), rng)


def baseline_fit(problem: GapProblem, rng: np.random.Generator) -> Fit:
    """The fit of the baseline without effects, made once."""
    if BASELINE not in problem.fits:
        problem.fits[BASELINE] = fitted(problem, BASELINE, rng)
    return problem.fits[BASELINE]


def with_remainder(problem: GapProblem, base: Fit, rng: np.random.Generator) -> Fit:
    """What `base` fits, fitted from there with a flexible remainder of something unknown."""
    hypothesis = replace(base.hypothesis, flexible=True)
    return fitted(problem, hypothesis, rng, base.z[None])


def _starts(problem: GapProblem, hypothesis: Hypothesis, rng: np.random.Generator) -> FloatArray:
    coordinates = problem.coordinates(hypothesis)
    if hypothesis.effects:
        found = scan(problem, baseline_fit(problem, rng), Hypothesis(hypothesis.effects))
        return found.starts(coordinates, STARTS)
    starts = np.zeros((len(_BASELINE_STARTS), coordinates.dimension))
    starts[:, 0] = _BASELINE_STARTS
    return starts


def _seen_from_the_other_end(landscape: Landscape, found: list[Optimum]) -> list[Optimum]:
    """The optima with those that a poor fit reaches with its places mirrored.

    Where an effect is large, the scan that the starts come from hardly tells an end from the other.
    """
    best = max(found, key=lambda each: each.log_posterior)
    squares = landscape.likelihood.squares(best.residual[None])
    if squares.min() < _POOR * len(best.residual):
        return found
    z = best.branch.z(best.w[None])[0]
    parameters = landscape.problem.coordinates(landscape.hypothesis).parameters
    places = [k for k, parameter in enumerate(parameters) if is_place(parameter)]
    mirrored = [_mirrored(z, some) for n in (1, 2) for some in combinations(places, n)]
    others = optima(landscape, np.array(mirrored)) if mirrored else []
    if not others:
        return found
    return optima(landscape, np.array([e.branch.z(e.w[None])[0] for e in (*found, *others)]))


def _mirrored(z: FloatArray, places: Sequence[int]) -> FloatArray:
    other = z.copy()
    other[list(places)] *= -1
    return other


def _fit(landscape: Landscape, found: list[Optimum], rng: np.random.Generator) -> Fit:
    found = sorted(found, key=lambda each: -each.log_evidence)
    log = np.array([each.log_evidence for each in found])
    best = max(found, key=lambda each: each.log_posterior)
    stretch = best.branch.stretch(best.w)
    node = int(landscape.likelihood.by_node(best.residual[None])[0].argmax())
    chosen = landscape.likelihood.nodes[node]
    return Fit(
        hypothesis=landscape.hypothesis,
        z=best.branch.z(best.w[None])[0],
        covariance=best.covariance * np.outer(stretch, stretch),
        predicted=landscape.problem.observations.value - best.residual,
        slopes=best.slopes / stretch,
        noise=chosen.covariance,
        model_error=chosen.model_error,
        draws=_draws(found, rng),
        log_fit=float(landscape.likelihood.log(best.residual[None])[0]),
        log_evidence=float(scipy.special.logsumexp(log)),
        log_evidence_sd=0.0,
        method="normal",
        peaks=tuple(
            Peak(each.branch.signs, each.w, each.covariance, each.log_evidence) for each in found
        ),
    )


def _draws(found: list[Optimum], rng: np.random.Generator) -> FloatArray:
    """Equal draws z (n, d) of the normal distributions on all optima."""
    log = np.array([each.log_evidence for each in found])
    counts = rng.multinomial(_DRAWS, np.exp(log - scipy.special.logsumexp(log)))
    return np.vstack(
        [
            each.branch.z(each.w + scattered(each.curvature, count, rng))
            for each, count in zip(found, counts, strict=True)
        ]
    )


def scattered(curvature: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Normal draws about 0 (count, d) by the curvature's own factor: its inverse may be too uneven.

    `curvature` (d, d) is the inverse of their covariance.
    """
    normal = rng.standard_normal((count, len(curvature)))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(curvature).T, normal.T).T)
