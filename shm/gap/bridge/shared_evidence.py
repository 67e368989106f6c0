"""The evidence of one hanger for effects that it may share with others.

The diagnosis of the hanger is turned back into likelihoods: probabilities over their priors, draws
of an effect's size over the prior of the size. So the priors of a single hanger drop out of what
several hangers show together, and its errors and laws stay in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shm.gap.causes.probabilities import NO_GAP, PAIR, SINGLE, UNKNOWN, ScoredHypothesis
from shm.gap.causes.scan import Scan
from shm.gap.causes.search import Attribution, Search, possible
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.hypotheses.coordinates import scale_free
from shm.gap.hypotheses.problem import GapProblem
from shm.inference.sampler.linear import Linear
from shm.inference.sampler.mixture import normalised, systematic
from shm.models.effects import Parameter, Variant, parameters_of
from shm.values import BoolArray, Diagnosis, FloatArray, Hanger, ModalTest

Place = tuple[str, str]
"""An effect of the catalogue and where it acts, in words."""

ALONE = SINGLE / (SINGLE + PAIR)
"""How often a shared cause is the only one: as often as one cause is in a single hanger."""


@dataclass(frozen=True)
class SharingOptions:
    """Hold the settings of evidence that hangers share, sizes in decades, numerical but for one.

    Sizes down to `below` what is visible count, by judgement: what one hanger sees by half a
    standard deviation, ten see by 1.5. `step` is the least scatter of sizes; normals so far apart
    add up evenly. `draws` give a mean to 3 % of its standard deviation. Points `about` so far from
    each other are those of a scan. A log has an exponential up to `most_gain`; nothing is divided
    by less than `tiny`, or has its logarithm.
    """

    below: float = 0.5
    step: float = 0.03
    draws: int = 1000
    about: float = 0.15
    most_gain: float = 500.0
    tiny: float = 1e-300


SHARING = SharingOptions()


@dataclass(frozen=True)
class Sizes:
    """The sizes x of an effect that these data could show, evenly likely before any data.

    x grows with the effect. It counts decades of a size, and of a stiffness downwards; of what has
    no scale, such as an angle, the whole range of the `parameter` counts 1.
    """

    parameter: Parameter

    def x(self, value: FloatArray) -> FloatArray:
        """Return x of values (n,) in their units, whatever their signs."""
        parameter = self.parameter
        if parameter.spread == "logarithmic":
            value = np.log10(np.abs(value))
        elif not scale_free(parameter):
            value = value / (parameter.upper - parameter.lower)
        return np.asarray(-value if parameter.zero > parameter.upper else value)

    def value(self, x: FloatArray) -> FloatArray:
        """Return the values (n,) of x, without a sign."""
        parameter = self.parameter
        x = -x if parameter.zero > parameter.upper else x
        if parameter.spread == "logarithmic":
            return np.asarray(10.0**x)
        return x if scale_free(parameter) else x * (parameter.upper - parameter.lower)

    def sign(self, value: FloatArray) -> FloatArray:
        """Return the signs (n,) of values; 1 of a parameter that has none."""
        return np.where(self.parameter.signed & (value < 0), -1.0, 1.0)

    @property
    def signs(self) -> FloatArray:
        return np.array([1.0, -1.0] if self.parameter.signed else [1.0])

    @property
    def ends(self) -> tuple[float, float]:
        """Return the least and the largest x."""
        x = self.x(np.array([self.parameter.lower, self.parameter.upper]))
        return float(x.min()), float(x.max())


@dataclass(frozen=True, eq=False)
class EffectEvidence:
    """The evidence for one effect at one place in one hanger, at points (n,) of its size.

    Points `x` with their `sign` are of `visible` sizes or of smaller ones. With sizes of density f
    the likelihood of a visible effect is the sum of `weight` f(x), against all that a hanger may
    have otherwise; that of a smaller one is the same sum over its points, against no effect.
    `tension_n` is that of the hanger with each. `log_mimic_odds` are those of something unknown
    that passes for the effect, against the effect.
    """

    sizes: Sizes
    x: FloatArray
    sign: FloatArray
    weight: FloatArray
    visible: BoolArray
    tension_n: FloatArray
    log_mimic_odds: float


@dataclass(frozen=True, eq=False)
class HangerEvidence:
    """One hanger of several, diagnosed for itself.

    `no_gap`, `gap` and `unknown` are the likelihoods of each, against all that a hanger may have.
    `tension_n` (n,) are equal draws over all of that.
    """

    hanger: Hanger
    tests: tuple[ModalTest, ...]
    diagnosis: Diagnosis
    no_gap: float
    gap: float
    unknown: float
    tension_n: FloatArray
    effects: Mapping[Place, EffectEvidence]


def weigh_hanger(
    hanger: Hanger,
    tests: Sequence[ModalTest],
    diagnosis: Diagnosis,
    attribution: Attribution,
    rng: np.random.Generator,
) -> HangerEvidence:
    """Return the evidence of a hanger from its diagnosis."""
    problem, none = attribution.search.problem, attribution.no_gap_probability
    parts = [(p, _tension_n(problem, fit, rng)[None]) for p, fit in possible(attribution)]
    tension_n = _resampled(parts, rng)[0]
    return HangerEvidence(
        hanger=hanger,
        tests=tuple(tests),
        diagnosis=diagnosis,
        no_gap=none / NO_GAP,
        gap=(1 - none) / (1 - NO_GAP),
        unknown=attribution.unexplained_probability / UNKNOWN,
        tension_n=tension_n,
        effects=dict(_effects(attribution, tension_n, rng)),
    )


_Held = list[tuple[float, ScoredHypothesis]]
"""Hypotheses that hold an effect at a place, each with its probability."""


def _effects(
    attribution: Attribution, tension_n: FloatArray, rng: np.random.Generator
) -> Iterator[tuple[Place, EffectEvidence]]:
    search, tried = attribution.search, _by_probability(attribution)
    problem, baseline = search.problem, search.baseline
    linear = Linear(problem.likelihood(Hypothesis()), baseline.slopes)
    residual = problem.value - baseline.predicted
    log_nothing = float(linear.marginal(residual[None], baseline.z[None])[0][0])
    for single, scan in search.scans.items():
        if not np.isfinite(scan.log_evidence):
            continue
        (effect,) = single.effects
        held = [each for each in tried if effect in each[1].hypothesis.effects]
        sizes = Sizes(problem.coordinates(single).effects[0])
        visible = _of_fits(problem, effect, held, sizes, rng)
        if visible is None:
            visible = _of_scan(scan, sizes, tension_n, rng)
        small, ratio = _too_small_to_see(search, scan, sizes, log_nothing, rng)
        factor = _bayes_factor(search, effect, held, any(_is_pair(each) for _, each in tried))
        span = factor * np.ptp(sizes.ends) * len(sizes.signs)
        x, sign, tensions = np.hstack([visible, small])
        yield (
            (effect[0], effect[1].at),
            EffectEvidence(
                sizes=sizes,
                x=x,
                sign=sign,
                weight=np.append(
                    np.full(visible.shape[1], span / visible.shape[1]), SHARING.step * ratio
                ),
                visible=np.arange(len(x)) < visible.shape[1],
                tension_n=tensions,
                log_mimic_odds=sum(
                    each.log_mimic - each.log_evidence
                    for _, each in held
                    if each.log_mimic is not None and not _is_pair(each)
                ),
            ),
        )


def _by_probability(attribution: Attribution) -> _Held:
    """Return each cause at each place where it was tried."""
    found: _Held = []
    for cause in attribution.explanations:
        if cause.probability > 0:
            share = normalised(np.array([each.log_evidence for each in cause.variants]))
            found += zip((cause.probability * share).tolist(), cause.variants, strict=True)
    return found


def _is_pair(each: ScoredHypothesis) -> bool:
    return len(each.hypothesis.effects) > 1


def _bayes_factor(
    search: Search, effect: tuple[str, Variant], held: _Held, tried_pairs: bool
) -> float:
    """Return that of an effect being there, alone or with another, against all there may be."""
    # One of so many effects, at one of so many places; an effect is in two of so many pairs.
    prior = 1 / (len(search.variants) * search.variants[effect[0]])
    alone = sum(p for p, each in held if not _is_pair(each)) / (SINGLE * prior)
    paired = sum(p for p, each in held if _is_pair(each)) / (2 * PAIR * prior)
    return ALONE * alone + (1 - ALONE) * paired if tried_pairs else alone


def _of_fits(
    problem: GapProblem,
    effect: tuple[str, Variant],
    held: _Held,
    sizes: Sizes,
    rng: np.random.Generator,
) -> FloatArray | None:
    """Return equal draws (3, n) of x, sign and tension over all fits with an effect, if any."""
    parts = []
    for probability, each in held:
        fit, effects = each.posterior, each.hypothesis.effects
        if fit is None or not probability:
            continue
        before = effects[: effects.index(effect)]
        column = sum(len(parameters_of(name, problem.hanger, other)) for name, other in before)
        value = problem.coordinates(fit.hypothesis).effect_values(fit.draws)[:, column]
        drawn = sizes.x(value), sizes.sign(value), _tension_n(problem, fit, rng)
        parts.append((probability, np.array(drawn)))
    return _resampled(parts, rng) if parts else None


def _of_scan(
    scan: Scan, sizes: Sizes, tension_n: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return the same of an effect that was only scanned; the tension is that of the hanger."""
    value = scan.effect[:, 0]
    rows = systematic(normalised(np.where(scan.seen, scan.log, -np.inf)), SHARING.draws, rng)
    spacing = np.ptp(sizes.x(value)) * len(sizes.signs) / len(value)
    x = sizes.x(value[rows]) + spacing * (rng.random(SHARING.draws) - 0.5)
    tensions = rng.choice(tension_n, SHARING.draws)
    return np.array([x.clip(*sizes.ends), sizes.sign(value[rows]), tensions])


def _too_small_to_see(
    search: Search, scan: Scan, sizes: Sizes, log_nothing: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return points (3, n) of x, sign and tension below the visible sizes, and their likelihoods.

    The latter (n,) are over that of no effect. A scan is as good as a fit there, since small
    effects are linear; far from all of its points they are those of no effect.
    """
    problem, baseline, every = search.problem, search.baseline, sizes.x(scan.effect[:, 0])
    rows = np.flatnonzero((every < sizes.ends[0]) & np.isfinite(scan.log))
    line = sizes.ends[0] - SHARING.step * (np.arange(np.ceil(SHARING.below / SHARING.step)) + 0.5)
    x, sign = np.tile(line, len(sizes.signs)), np.repeat(sizes.signs, len(line))
    near = np.exp(-(((every[rows] - x[:, None]) / SHARING.about) ** 2) / 2)
    near *= sizes.sign(scan.effect[rows, 0]) == sign[:, None]
    near /= near.sum(axis=1, keepdims=True) + SHARING.tiny
    steps = np.vstack([np.zeros(len(baseline.z)), scan.step[rows]])
    moved_n = problem.tension_n(Hypothesis(), baseline.z + steps)
    tension_n = rng.choice(_tension_n(problem, baseline, rng), len(x))
    tension_n = tension_n * (1 + near @ (moved_n[1:] / moved_n[0] - 1))
    gain = np.minimum(scan.log[rows] - log_nothing, SHARING.most_gain)
    return np.array([x, sign, tension_n]), 1 + near @ np.expm1(gain)


def _resampled(parts: Sequence[tuple[float, FloatArray]], rng: np.random.Generator) -> FloatArray:
    """Return equal draws (k, draws) of parts (k, n), each with its probability."""
    weight = np.concatenate([np.full(each.shape[1], p / each.shape[1]) for p, each in parts])
    rows = systematic(weight / weight.sum(), SHARING.draws, rng)
    return np.asarray(np.hstack([each for _, each in parts])[:, rows])


def _tension_n(problem: GapProblem, fit: Fit, rng: np.random.Generator) -> FloatArray:
    """Return that of a fit's draws; NaN of a bar that carries none."""
    if not problem.hanger.nominal_tension_n:
        return np.full(len(fit.draws), np.nan)
    return problem.tension_n(fit.hypothesis, fit.draws, rng)
