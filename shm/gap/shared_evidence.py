"""What one hanger says of a cause that it may share with others: how much it speaks for the effect
being there, by the effect's size, and what the tension then is.

A diagnosis of one hanger is read back as likelihoods: the probability of an effect over its prior,
and the draws of its size over the prior of the size. So the priors of a single hanger go out of
what several hangers say together, and its errors and laws stay in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.gap.attribution import Attribution, Explanation, possible
from shm.gap.contract import Fit, Hypothesis
from shm.gap.coordinates import scale_free
from shm.gap.detectability import Scan, marginal
from shm.gap.law_error import mixed
from shm.gap.model_probabilities import NO_GAP, PAIR, SINGLE, UNKNOWN, ScoredHypothesis
from shm.gap.problem import GapProblem
from shm.gap.search import Search
from shm.inference.mixture import normalised, systematic
from shm.models.effects import Parameter, Variant, parameters_of
from shm.values import Diagnosis, FloatArray, Hanger, ModalTest

Place = tuple[str, str]
"""An effect of the catalogue and where it acts, in words."""

ALONE = SINGLE / (SINGLE + PAIR)
"""How often a shared cause is the only one: as often as one cause is in a single hanger."""

_TINY = 1e-300  # technical: what a logarithm is taken of
_MOST_GAIN = 3.0
"""Judgement, log likelihood: what cannot be seen gains no more, unless the scan is not linear."""
_DRAWS = 400  # technical: of each fit, a mean to 5 % of its standard deviation


@dataclass(frozen=True, eq=False)
class Reach:
    """Sizes x that these data could show: `lower` to `upper`, evenly likely before any data.

    x grows with the effect. It counts decades of a size, and of a stiffness downwards; of what has
    no scale of its own, such as an angle, the `parameter`'s whole range counts 1.
    """

    parameter: Parameter
    lower: float
    upper: float

    @classmethod
    def of(cls, parameter: Parameter) -> Reach:
        """Of the first parameter of an effect, as the data cut its prior."""
        whole = cls(parameter, 0.0, 0.0)
        ends = whole.x(np.array([parameter.lower, parameter.upper]))
        return cls(parameter, float(ends.min()), float(ends.max()))

    def x(self, value: FloatArray) -> FloatArray:
        """Of values (n,) in their units, whatever their signs."""
        if self.parameter.spread == "logarithmic":
            return np.asarray(np.log10(np.abs(value)))
        return np.asarray(value * self._direction / self._unit)

    def value(self, x: FloatArray) -> FloatArray:
        """The inverse of `x`, without a sign."""
        if self.parameter.spread == "logarithmic":
            return np.asarray(10.0**x)
        return np.asarray(x * self._direction * self._unit)

    @property
    def width(self) -> float:
        return self.upper - self.lower

    @property
    def _direction(self) -> float:
        return -1.0 if self.parameter.zero > self.parameter.upper else 1.0

    @property
    def _unit(self) -> float:
        return 1.0 if scale_free(self.parameter) else self.parameter.upper - self.parameter.lower


@dataclass(frozen=True, eq=False)
class Faint:
    """Sizes below those that one hanger could show, at points of a scan.

    `ratio` (k,) is their likelihood over that of no effect, `tension_n` (k,) draws of the tension
    that goes with each. What one hanger sees by half a standard deviation, twenty see by two.
    """

    x: FloatArray
    sign: FloatArray
    ratio: FloatArray
    tension_n: FloatArray


@dataclass(frozen=True, eq=False)
class Evidence:
    """Of one effect at one place in one hanger.

    `bayes_factor` is that of the effect being there, alone or with another one, against what a
    hanger may have otherwise. `x` (n,), `sign` (n,) and `tension_n` (n,) are equal draws of the
    posterior, or of a scan where the effect was not worth a fit. `log_mimic_odds` are those of
    something unknown that passes for the effect against the effect itself.
    """

    bayes_factor: float
    reach: Reach
    x: FloatArray
    sign: FloatArray
    tension_n: FloatArray
    log_mimic_odds: float
    faint: Faint


@dataclass(frozen=True, eq=False)
class Patient:
    """One hanger of several, diagnosed for itself.

    `no_gap` and `gap` are how much its data speak for either, against what a hanger may have
    otherwise; `unknown` for something that the catalogue lacks. `tension_n` (n,) are draws over
    all of that.
    """

    hanger: Hanger
    tests: tuple[ModalTest, ...]
    diagnosis: Diagnosis
    no_gap: float
    gap: float
    unknown: float
    tension_n: FloatArray
    effects: Mapping[Place, Evidence]


def patient(
    hanger: Hanger,
    tests: Sequence[ModalTest],
    diagnosis: Diagnosis,
    attribution: Attribution,
    rng: np.random.Generator,
) -> Patient:
    """A hanger as its own diagnosis sees it."""
    none = attribution.no_gap_probability
    weight, fits = zip(*possible(attribution), strict=True)
    draws = [_tension_n(attribution.search.problem, fit) for fit in fits]
    tension_n = mixed(draws, np.array(weight), rng)
    return Patient(
        hanger=hanger,
        tests=tuple(tests),
        diagnosis=diagnosis,
        no_gap=none / NO_GAP,
        gap=(1 - none) / (1 - NO_GAP),
        unknown=attribution.unexplained_probability / UNKNOWN,
        tension_n=tension_n,
        effects=dict(_effects(attribution, tension_n, rng)),
    )


@dataclass(frozen=True, eq=False)
class _Held:
    """An effect at a place within a hypothesis that holds it, `index` says as which."""

    scored: ScoredHypothesis
    index: int
    probability: float


def _effects(
    attribution: Attribution, tension_n: FloatArray, rng: np.random.Generator
) -> Iterator[tuple[Place, Evidence]]:
    search = attribution.search
    singles: dict[Place, list[_Held]] = {}
    pairs: dict[Place, list[_Held]] = {}
    variants: dict[Place, Variant] = {}
    for explanation in attribution.explanations:
        into = pairs if explanation.is_pair else singles
        for scored, probability in _by_variant(explanation):
            for index, (name, variant) in enumerate(scored.hypothesis.effects):
                place = name, variant.at
                variants.setdefault(place, replace(variant, law=0))
                into.setdefault(place, []).append(_Held(scored, index, probability))
    for place, variant in variants.items():
        # One of so many effects, at one of so many places.
        prior = 1 / (len(search.variants) * search.variants[place[0]])
        alone, paired = singles.get(place, []), pairs.get(place, [])
        own = sum(each.probability for each in alone) / (SINGLE * prior)
        joint = sum(each.probability for each in paired) / (2 * PAIR * prior)
        factor = ALONE * own + (1 - ALONE) * joint if pairs else own
        held = [*alone, *paired]
        act = place[0], variant
        yield place, _evidence(search, act, held, factor, tension_n, rng)


def _by_variant(explanation: Explanation) -> Iterator[tuple[ScoredHypothesis, float]]:
    """Each place where a cause was tried, with its share of the cause's probability."""
    share = normalised(np.array([each.log_evidence for each in explanation.variants]))
    for each, part in zip(explanation.variants, share, strict=True):
        yield each, float(part) * explanation.probability


def _evidence(
    search: Search,
    place: tuple[str, Variant],
    held: Sequence[_Held],
    factor: float,
    tension_n: FloatArray,
    rng: np.random.Generator,
) -> Evidence:
    problem, single = search.problem, Hypothesis((place,))
    own = len(problem.names(Hypothesis()))
    reach = Reach.of(problem.coordinates(single).parameters[own])
    mimic = sum(
        each.scored.log_mimic - each.scored.log_evidence
        for each in held[:1]
        if each.scored.log_mimic is not None
    )
    drawn = [
        (each.probability, *_draws(problem, fit, each.index, reach))
        for each in held
        if (fit := each.scored.posterior) is not None and each.probability > 0
    ]
    faint = _faint(search, search.scans[single], reach, rng)
    if not drawn:
        x, sign = _screened(search.scans[single], reach, rng)
        return Evidence(factor, reach, x, sign, rng.choice(tension_n, _DRAWS), mimic, faint)
    weight = np.concatenate([np.full(len(x), share / len(x)) for share, x, *_ in drawn])
    rows = systematic(weight / weight.sum(), _DRAWS, rng)
    x, sign, tensions = (np.concatenate([each[k] for each in drawn])[rows] for k in (1, 2, 3))
    return Evidence(factor, reach, x, sign, tensions, mimic, faint)


def _screened(scan: Scan, reach: Reach, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Sizes x and their signs (n,) of an effect that was only scanned, as its points say."""
    x = reach.x(scan.effect[:, 0])
    seen = (x >= reach.lower) & (scan.weight > 0)
    log = np.where(seen, scan.marginal.log_mean, -np.inf) + np.log(np.maximum(scan.weight, _TINY))
    rows = systematic(normalised(log), _DRAWS, rng)
    sign = np.where(scan.effect[rows, 0] < 0, -1.0, 1.0)
    spacing = reach.width / len(np.unique(x[seen]))
    spread = x[rows] + spacing * (rng.random(_DRAWS) - 0.5)
    return spread, sign if reach.parameter.signed else np.ones(_DRAWS)


def _faint(search: Search, scan: Scan, reach: Reach, rng: np.random.Generator) -> Faint:
    """Of a scan: small effects are linear, so that it is as good as a fit."""
    problem, baseline = search.problem, search.baseline
    nothing = marginal(problem, Hypothesis(), baseline, np.zeros((1, len(baseline.predicted))))
    x = reach.x(scan.effect[:, 0])
    rows = np.flatnonzero((x < reach.lower) & (scan.weight > 0))
    sign = np.where(scan.effect[rows, 0] < 0, -1.0, 1.0)
    log = scan.marginal.log_likelihood[rows] - nothing.log_likelihood[0]
    own = _tension_n(problem, replace(baseline, draws=baseline.z[None]))
    moved = replace(baseline, draws=baseline.z + scan.marginal.follow[rows])
    scatter = rng.choice(_tension_n(problem, baseline), len(rows)) / own
    tension_n = _tension_n(problem, moved) * scatter
    sign = sign if reach.parameter.signed else np.ones(len(rows))
    return Faint(x[rows], sign, np.exp(log.clip(max=_MOST_GAIN)), tension_n)


def _draws(
    problem: GapProblem, fit: Fit, index: int, reach: Reach
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sizes x, their signs and tensions (n,) of one effect of a fit."""
    before = fit.hypothesis.effects[:index]
    column = len(problem.names(Hypothesis())) + sum(
        len(parameters_of(name, problem.hanger, variant)) for name, variant in before
    )
    value = problem.theta(fit.hypothesis, fit.draws)[:, column]
    sign = np.where(value < 0, -1.0, 1.0) if reach.parameter.signed else np.ones(len(value))
    return reach.x(value), sign, _tension_n(problem, fit)


def _tension_n(problem: GapProblem, fit: Fit) -> FloatArray:
    """Of a fit's draws; NaN of a bar that carries none."""
    if not problem.hanger.nominal_tension_n:
        return np.full(len(fit.draws), np.nan)
    return problem.tension_n(fit.hypothesis, fit.draws)
