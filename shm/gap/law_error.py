"""How far an effect's law may be off: a real one does not follow the catalogue to the letter.

Corrosion has no edges, sockets taper, joints slip by another power. The larger an effect, the more
its law's own error stands out of the noise, and without an allowance a second effect or something
unknown would take the blame. So the data may err about a prediction in two ways: by an unknown
multiple, about 1 in size, of what each other law of the effect would change; and by a fraction of
what the effect does beyond what the baseline can follow, the same in all tests of a mode: of what
it does to that very mode or, where a law shifts its action from mode to mode, to the modes of a
test and plane on the whole. The fraction is unknown.

So what is left beside a large effect often looks like a small one of another kind. Where the second
cause of a pair moves the data by little against the first, it counts for the most part as the law
of the first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
import scipy

from shm.gap.contract import Covariance, Design, Fit, Hypothesis, NoiseNode
from shm.gap.fit import fitted, scattered
from shm.gap.likelihood import Likelihood
from shm.gap.model_probabilities import CALIBRATION, Family, Share
from shm.gap.noise import alike_in_planes, same_mode, smooth_over_orders
from shm.gap.problem import GapProblem
from shm.inference.mixture import normalised
from shm.models.effects import EFFECTS
from shm.values import FloatArray

SHOWN = 3.0
"""Log odds against an exact law from which on the data show that it is off."""


@dataclass(frozen=True, eq=False)
class _Linear:
    """A posterior about a fit, all parameters linear: its log evidence, step and curvature.

    The parameters are the fit's own and, behind them, standard normal multiples of other laws.
    """

    errors: Covariance
    log_evidence: float
    step: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, eq=False)
class ByLaws:
    """A fit with effects whose laws may be off.

    `gain` is what its log evidence gains, never less than the log of the prior probability that the
    laws are exact; `mimic` is the gain if it is something unknown that passes for the effects.
    `fit` is that with the likeliest allowance where the data show that the laws are off. `draws`
    (n, d) are of the posterior by all allowances. `log_evidences` (1 + allowances,) are of exact
    laws and of each allowance.
    """

    gain: float
    mimic: float
    fit: Fit
    draws: FloatArray
    log_evidences: FloatArray


def by_its_laws(problem: GapProblem, baseline: Fit, fit: Fit, rng: np.random.Generator) -> ByLaws:
    """A fit with effects by laws that may be off.

    The prediction is taken as linear about the fit; where the data show that the laws are off,
    about the fit by the likeliest allowance.
    """
    exact = _linear(problem, fit, fit.noise, fit.slopes)
    about, others = fit, _changes(problem, fit)
    off = _off(problem, baseline, about, others)
    if _shown(exactly(fit.hypothesis), exact, off):
        about = _fitted_anew(problem, fit, others, off, rng)
        known = replace(about, noise=fit.noise, model_error=fit.model_error)
        off = _off(problem, baseline, known, _changes(problem, known))
    ways = [(exactly(fit.hypothesis), exact), *off]
    evidence = np.array([each.log_evidence for _, each in ways])
    with np.errstate(divide="ignore"):  # a share may be 0
        weight, mimic = np.log([share for share, _ in ways]).T + evidence
    draws = [_scattered(about, each, rng) for _, each in off]
    return ByLaws(
        gain=float(scipy.special.logsumexp(weight) - exact.log_evidence),
        mimic=float(scipy.special.logsumexp(mimic) - exact.log_evidence),
        fit=about,
        draws=mixed([fit.draws, *draws], normalised(weight), rng),
        log_evidences=evidence,
    )


def mixed(draws: Sequence[FloatArray], weight: FloatArray, rng: np.random.Generator) -> FloatArray:
    """As many draws (n, ...) as the first of several has, taken from all by their weights (k,)."""
    counts = rng.multinomial(len(draws[0]), weight / weight.sum())
    chosen = [rng.choice(each, count) for each, count in zip(draws, counts, strict=True)]
    return np.concatenate(chosen)


def _changes(problem: GapProblem, fit: Fit) -> FloatArray:
    """What the other laws of a fit's effects, one at a time, change of its prediction (data, k)."""
    theta = problem.theta(fit.hypothesis, fit.z[None])
    found = [
        problem.predict_at(other, theta)[0] - fit.predicted for other in otherwise(fit.hypothesis)
    ]
    return np.column_stack([np.empty((len(fit.predicted), 0)), *found])


def otherwise(hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The same effects, one of them by another law."""
    for index, (name, variant) in enumerate(hypothesis.effects):
        for law in range(len(EFFECTS[name].other_laws) + 1):
            if law != variant.law:
                effects = list(hypothesis.effects)
                effects[index] = name, replace(variant, law=law)
                yield replace(hypothesis, effects=tuple(effects))


def _allowed(fit: Fit, allowance: Allowance) -> Covariance:
    """The errors of a fit with those of its law."""
    off, alike = allowance.off, allowance.alike
    count = len(alike)
    return replace(
        fit.noise,
        frequency=fit.noise.frequency + np.outer(off[:count], off[:count]) * alike,
        shape=fit.noise.shape + off[count:] ** 2,
    )


def _off(
    problem: GapProblem, baseline: Fit, fit: Fit, others: FloatArray
) -> list[tuple[Share, _Linear]]:
    """A fit's posterior by each allowance, `others` (data, k) being what other laws change."""
    wide = np.column_stack([fit.slopes, others])
    return [
        (each.share, _linear(problem, fit, _allowed(fit, each), wide))
        for each in allowances(problem, baseline, fit)
    ]


def _linear(problem: GapProblem, fit: Fit, errors: Covariance, slopes: FloatArray) -> _Linear:
    """About a fit's most probable point; `slopes` (data, d + k), the first d its own."""
    likelihood = Likelihood.of(errors, fit.model_error)
    z = np.concatenate([fit.z, np.zeros(slopes.shape[1] - len(fit.z))])
    residual = problem.observations.value - fit.predicted
    inner, step, square, followed = likelihood.linear(slopes, residual, z)
    misfit = square + z @ z - followed
    log = likelihood.log_height[0] - np.linalg.slogdet(inner)[1] / 2 - misfit / 2
    return _Linear(errors, float(log), step, inner)


def _scattered(fit: Fit, linear: _Linear, rng: np.random.Generator) -> FloatArray:
    """Draws (n, d) of the fit's own parameters about where an allowance has them."""
    own = len(fit.z)
    away = linear.step + scattered(linear.curvature, len(fit.draws), rng)
    return np.asarray(fit.z + away[:, :own])


def _shown(share: Share, exact: _Linear, off: Sequence[tuple[Share, _Linear]]) -> bool:
    """Whether the data show that an exact law is off."""
    allowed = scipy.special.logsumexp(
        [np.log(share.own) + each.log_evidence for share, each in off]
    )
    return bool(allowed > np.log(share.own) + exact.log_evidence + SHOWN)


def _fitted_anew(
    problem: GapProblem,
    fit: Fit,
    others: FloatArray,
    off: Sequence[tuple[Share, _Linear]],
    rng: np.random.Generator,
) -> Fit:
    """By the likeliest allowance; the other laws' changes are among its errors.

    Its evidence stays that of the exact law.
    """
    likeliest = max(off, key=lambda each: np.log(each[0].own) + each[1].log_evidence)[1]
    own, count = len(fit.z), problem.design.frequencies
    errors = replace(
        likeliest.errors,
        frequency=likeliest.errors.frequency + others[:count] @ others[:count].T,
        shape_loads=np.column_stack([likeliest.errors.shape_loads, others[count:]]),
    )
    likelihood = Likelihood.of(errors, fit.model_error)
    starts = np.array([fit.z, fit.z + likeliest.step[:own]])
    moved = fitted(problem, fit.hypothesis, rng, starts, likelihood)
    return replace(moved, log_evidence=fit.log_evidence, method=fit.method, peaks=fit.peaks)


Way = tuple[Literal["exact", "mode", "whole", "rough"], float]
_Off = tuple[Way, FloatArray, Share]


class Allowance(NamedTuple):
    """By how much data are off (data,), how frequencies go together (F, F), how likely that is.

    `way` is what the law is off by: a fraction of the effect in a `mode`, on the `whole`, or where
    the law is `rough`.
    """

    off: FloatArray
    alike: FloatArray
    share: Share
    way: Way


def allowances(problem: GapProblem, baseline: Fit, fit: Fit) -> list[Allowance]:
    """For the laws of a fit's effects; with `exactly`, their shares add to 1.

    All are as likely from mode to mode as smooth over the orders. A level is one number of a test,
    while every mode rings at its own and dies away at its own pace: so the law of an effect that
    goes with it may be rough, and so may be what passes for such an effect.
    """
    told, design, shift = CALIBRATION, problem.design, fit.predicted - baseline.predicted
    whole = _on_the_whole(design, shift)
    off: list[_Off] = [(("mode", f), f * shift, share) for f, share in told.of_a_mode.items()]
    off += [(("whole", f), f * whole, share) for f, share in told.on_the_whole.items()]
    in_a_plane = same_mode(design), smooth_over_orders(design)
    if not goes_with_level(fit.hypothesis):
        return list(_each(off, in_a_plane))
    raised = _by_levels(problem, fit)
    rough: list[_Off] = [
        (("rough", f), f * raised, Share(told.rough * share, told.rough * share))
        for f, share in told.where_rough.items()
    ]
    off = [(way, error, _unless_rough(share)) for way, error, share in off]
    return [*_each(off, in_a_plane), *_each(rough, (*in_a_plane, alike_in_planes(design)))]


def exactly(hypothesis: Hypothesis) -> Share:
    """How likely it is that the laws of a hypothesis' effects are exact."""
    exact = CALIBRATION.exact
    return _unless_rough(exact) if goes_with_level(hypothesis) else exact


def _unless_rough(share: Share) -> Share:
    return Share(*((1 - CALIBRATION.rough) * each for each in share))


def _each(off: Sequence[_Off], orders: Sequence[FloatArray]) -> Iterator[Allowance]:
    """By how much data may be off with every way to go together, all ways as likely."""
    for way, error, share in off:
        for alike in orders:
            yield Allowance(error, alike, Share(*(each / len(orders) for each in share)), way)


def goes_with_level(hypothesis: Hypothesis) -> bool:
    """Whether one of its effects follows the amplitude of the hits."""
    return any("amplitude" in EFFECTS[name].follows for name, _ in hypothesis.effects)


def _by_levels(problem: GapProblem, fit: Fit) -> FloatArray:
    """What a fit's effects that go with the level do to its prediction (data,)."""
    effects = fit.hypothesis.effects
    others = [i for i, each in enumerate(effects) if not goes_with_level(Hypothesis((each,)))]
    return np.asarray(fit.predicted - problem.predicted_with(fit, others))


def _on_the_whole(design: Design, shift: FloatArray) -> FloatArray:
    """Root mean squares of a shift (data,) over each test and plane, and over each shape."""
    planes = 1 + int(design.frequency_plane.max())
    own = design.frequency_test * planes + design.frequency_plane
    group = np.concatenate([own, own.max() + 1 + design.shape_mode])
    mean = np.bincount(group, shift**2) / np.maximum(np.bincount(group), 1)
    return np.asarray(np.sqrt(mean)[group])


def without_minor_cause(
    problem: GapProblem, baseline: Fit, kinds: Sequence[Family], chances: FloatArray
) -> FloatArray:
    """The probabilities (families,) with those of pairs given to the one effect that they lean on.

    To an effect that was not worth a fit nothing is given: its law is not nearly right.
    """
    moved, odds = chances.copy(), CALIBRATION.minor_law_odds
    plain = [i for i, kind in enumerate(kinds) if not kind.flexible]
    alone = {kinds[i].name: i for i in plain if kinds[i].effects == 1 and kinds[i].best.fit}
    for i in plain:
        larger, part = second_cause(problem, baseline, kinds[i].best.fit)
        if larger in alone and part <= CALIBRATION.minor_below:
            share = chances[i] * odds / (1 + odds)
            moved[i] -= share
            moved[alone[larger]] += share
    return moved


def second_cause(problem: GapProblem, baseline: Fit, fit: Fit | None) -> tuple[str, float]:
    """The name of the larger effect of a pair, and how far the other moves the data against it.

    A fault of the law is the same in all tests: what differs from test to test is a cause, and as
    large as the first (1); so is what is no pair, of name "".
    """
    if fit is None or len(fit.hypothesis.effects) != 2:
        return "", 1.0
    moves = [_added(problem, baseline, fit, index) for index in (0, 1)]
    large = int(np.argmax(moves))
    (name, _), (second, variant) = fit.hypothesis.effects[large], fit.hypothesis.effects[1 - large]
    differs = bool(EFFECTS[second].follows or variant.test)
    return name, 1.0 if differs else moves[1 - large] / max(moves[large], np.finfo(float).tiny)


def _added(problem: GapProblem, baseline: Fit, fit: Fit, index: int) -> float:
    """By how many standard deviations one effect of a pair moves the data beside the other one.

    Beyond what the baseline's own parameters can follow.
    """
    shift = fit.predicted - problem.predicted_with(fit, [1 - index])
    least = min(problem.likelihood(Hypothesis()).nodes, key=lambda node: node.model_error)
    return float(np.sqrt(max(_beyond(shift, baseline, least), 0.0)))


def _beyond(shift: FloatArray, baseline: Fit, errors: NoiseNode) -> float:
    """The square of a shift (data,), in standard deviations, beyond what the baseline's parameters
    can follow."""
    likelihood, middle = Likelihood([errors]), np.zeros(len(baseline.z))
    _, _, square, followed = likelihood.linear(baseline.slopes, shift, middle)
    return square - followed
