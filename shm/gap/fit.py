"""Hypotheses that these data could show: which are worth a full fit, and the fit, with its evidence
by Laplace's method.

Each single effect, at each place where it may act, is first tried linearised, on top of a fit
without it. Laplace's method (Tierney and Kadane 1986) puts a normal distribution on each of the
most probable points; the evidence is the sum of their integrals. Mirror images count as what they
are: two.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy

from shm.errors import BadInput, UsageError
from shm.gap.contract import Fit, Hypothesis, Peak
from shm.gap.coordinates import is_place
from shm.gap.detectability import Scan, marginal, scan
from shm.gap.likelihood import Likelihood
from shm.gap.model_probabilities import ScoredHypothesis
from shm.gap.optimiser import Landscape, Optimum, optima
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.values import FloatArray

IN_BASELINE = {
    "beam2": ("rotational_end_flexibility",),
    "solid1": ("rotational_end_flexibility", "translational_end_flexibility"),
    "solid2": ("rotational_end_flexibility",),
}
"""Effects that a baseline class has as parameters of its own."""


def hypotheses(problem: GapProblem, without: tuple[str, ...] = ()) -> tuple[Hypothesis, ...]:
    """Baseline + one effect, for every variant, in the order of the catalogue.

    Left out are the effects `without`, those that the baseline has itself and those that these
    data cannot show. Raises UsageError for a name that is not in the catalogue.
    """
    unknown = sorted(set(without) - set(EFFECTS))
    if unknown:
        raise UsageError(
            f"No effect is called {', '.join(unknown)}. The catalogue has {', '.join(EFFECTS)}."
        )
    survey = problem.observations.design.survey
    return tuple(
        Hypothesis(((name, variant),))
        for name, effect in EFFECTS.items()
        if name not in without and name not in invisible(problem)
        for variant in effect.variants(problem.hanger, survey)
    )


def invisible(problem: GapProblem) -> dict[str, str]:
    """The effects that cannot be told from the baseline, and why in a sentence each."""
    survey = problem.observations.design.survey
    reasons = {name: each.invisible(problem.hanger, survey) for name, each in EFFECTS.items()}
    for name in IN_BASELINE.get(problem.baseline, ()):
        reasons[name] = f"The baseline {problem.baseline} has it as parameters of its own."
    return {name: reason for name, reason in reasons.items() if reason}


def tried_by_screening(
    problem: GapProblem, before: Fit, scans: Mapping[Hypothesis, Scan]
) -> tuple[ScoredHypothesis, ...]:
    """What scans on top of a fit say, the best first, as gains on it to stand beside fits."""
    nothing = marginal(problem, Hypothesis(), before, np.zeros((1, len(before.predicted))))
    best = ScoredHypothesis.fitted(before, len(before.z))
    level = float(nothing.log_likelihood[0])
    tried = [
        ScoredHypothesis(
            hypothesis,
            before.log_evidence + found.log_evidence - level,
            best.log_fit + float(found.marginal.log_peak.max()) - level,
        )
        for hypothesis, found in scans.items()
    ]
    return tuple(sorted(tried, key=lambda each: -each.log_evidence))


def varied(
    tried: Sequence[ScoredHypothesis], alike: int, most: int
) -> tuple[ScoredHypothesis, ...]:
    """The best by their evidence, at most `most`, and no more than `alike` of one family."""
    before: Counter[str] = Counter()
    kept = []
    for each in sorted(tried, key=lambda each: -each.log_evidence):
        before[each.hypothesis.name] += 1
        if before[each.hypothesis.name] <= alike:
            kept.append(each)
    return tuple(kept[:most])


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
    return np.vstack([starts, problem.near])


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
    mirrored = [
        np.where(np.isin(np.arange(len(z)), some), -z, z)
        for n in (1, 2)
        for some in combinations(places, n)
    ]
    others = optima(landscape, np.array(mirrored)) if mirrored else []
    if not others:
        return found
    return optima(landscape, np.array([e.branch.z(e.w[None])[0] for e in (*found, *others)]))


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
