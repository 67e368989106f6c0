"""From evidences to probabilities: Bayes' rule, once.

    P(h | data) ~ prior(h) x evidence(h) x P(misfit | h)
    P(cause | data) = sum over h of P(cause | h) P(h | data)

Hypotheses h are families (one effect or pair, wherever it may act), each with or without something
unknown beside it, and something unknown that passes for a family. A family has the same prior
however many variants it has, so that an effect does not become likelier by being tried in more
places (Scott and Berger, Ann. Stat. 38, 2010); its evidence is the mean over them. The misfit (a
p-value) is what the evidence does not hold: whether even the likeliest explanation fits
(`probabilities`). What a hypothesis is in truth, P(cause | h), trials have taught
(`calibration.toml`): a pair with a minor second cause is for the most part one cause with an error
of its law (`without_minor_cause` in `shm.gap.law_error`), and a free remainder sometimes a cause
that was not found (`undetected_share`); every other h is what its name says.

That file, which `tests/benchmarks/gap_calibration.py` writes, says too how often effects imitate
what is not in the catalogue and how far their laws are off.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from shm.errors import BadInput
from shm.gap.contract import Fit, Hypothesis, Method
from shm.values import FloatArray

FILE = Path(__file__).with_name("calibration.toml")


class Share(NamedTuple):
    """Prior probabilities: that an effect's own law is off by so much, and that something unknown
    is that passes for it."""

    own: float
    unknown: float


@dataclass(frozen=True)
class Provenance:
    """The trial that taught the values, and how many answers spoke for them."""

    trial: str
    seeds: str
    cases: str
    answers: str
    date: date
    command: str


@dataclass(frozen=True)
class Calibration:
    """The values, each explained in the file.

    `mimics_one` and `mimics_two` are shares of what is not in the catalogue; `in_mimicking_pairs`
    and `with_turned_sensors` count the pairs in which each effect led falsely. `exact`, `of_a_mode`
    and `on_the_whole` (by fraction) add to 1, and so does `where_rough`.
    """

    provenance: Provenance
    mimics_one: float
    mimics_two: float
    in_mimicking_pairs: Mapping[str, int]
    with_turned_sensors: Mapping[str, int]
    undetected_share: float
    minor_below: float
    minor_law_odds: float
    exact: Share
    of_a_mode: Mapping[float, Share]
    on_the_whole: Mapping[float, Share]
    rough: float
    where_rough: Mapping[float, float]

    @property
    def mimicking_pairs(self) -> int:
        """All pairs that led falsely."""
        return sum(self.in_mimicking_pairs.values()) // 2 + sum(self.with_turned_sensors.values())


def read_calibration(file: Path = FILE) -> Calibration:
    """The values of a file; raises BadInput where it lacks one."""
    try:
        return _values(tomllib.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a whole calibration ({error!r}).",
            file=file,
            remedy="Write it anew with tests/benchmarks/gap_calibration.py.",
        ) from error


def _values(told: dict[str, Any]) -> Calibration:
    mimic, law, rough = told["mimic"], told["law"], told["rough_law"]
    return Calibration(
        provenance=Provenance(**told["provenance"]),
        mimics_one=mimic["one_effect"],
        mimics_two=mimic["two_effects"],
        in_mimicking_pairs=mimic["in_pairs"],
        with_turned_sensors=mimic["with_turned_sensors"],
        undetected_share=told["undetected"]["share"],
        minor_below=told["minor"]["below"],
        minor_law_odds=float(told["minor"]["law_odds"]),
        exact=Share(**law["exact"]),
        of_a_mode={each.pop("fraction"): Share(**each) for each in law["of_a_mode"]},
        on_the_whole={each.pop("fraction"): Share(**each) for each in law["on_the_whole"]},
        rough=rough["probability"],
        where_rough={each["fraction"]: each["share"] for each in rough["of_a_mode"]},
    )


CALIBRATION = read_calibration()
# Before any data, judgement: who asks for a diagnosis mostly has a gap, and one cause is commoner
# than two. Blind trials plant the same mix; where it is another, odds are off by the ratio.
NO_GAP = 0.25
SINGLE = 0.5
PAIR = 0.125
UNKNOWN = 0.125

AND_UNKNOWN = PAIR / (SINGLE + PAIR) * UNKNOWN / (SINGLE + UNKNOWN)
"""How often something unknown comes with an effect or a pair, to how often these come alone: as
often as a second cause comes at all, and as seldom as a cause is unknown."""

LEAST_P_VALUE = 1e-4
"""Of smaller ones no more is known than that they are small: tails are not that normal."""

EVEN = 0.2
"""Judgement: so much of what mimics pairs is shared evenly by all, as what is unknown need not
resemble the catalogue's effects, from which the counts are. At 0 a pair that never led falsely
would be claimed without doubt; at 1 the counts would say nothing."""

_SENSORS = "sensor_misalignment"


@dataclass(frozen=True, eq=False)
class ScoredHypothesis:
    """A hypothesis with its evidence; `fit` is None where screening was enough.

    `log_mimic` is the log evidence of something unknown that passes for its effects, None where
    their laws were not looked at. `draws` (n, d) are of the posterior by all laws.
    `log_fit` is the log likelihood at its best, less what the baseline's own parameters and the
    bar's deviations pay there for lying off their priors: a baseline that fits by an unlikely bar
    fits less well.
    """

    hypothesis: Hypothesis
    log_evidence: float
    log_fit: float
    fit: Fit | None = None
    log_mimic: float | None = None
    draws: FloatArray | None = None

    @property
    def posterior(self) -> Fit | None:
        """The fit by all laws of its effects: what it says of parameters."""
        if self.fit is None or self.draws is None:
            return self.fit
        return replace(self.fit, draws=self.draws)

    @property
    def method(self) -> Method:
        return self.fit.method if self.fit is not None else "screened"

    @classmethod
    def fitted(cls, fit: Fit, common: int) -> ScoredHypothesis:
        """Of a fit whose first `common` parameters are those of the baseline and the bar."""
        unlikely = float(np.sum(fit.z[:common] ** 2)) / 2
        return cls(fit.hypothesis, fit.log_evidence, fit.log_fit - unlikely, fit)


@dataclass(frozen=True, eq=False)
class Family:
    """What was tried of one effect, or one pair, wherever it may act, the best first.

    `log_mimic` is the log evidence of something unknown that passes for it, `mimic_odds` the
    odds of that against the family itself, before any data.
    """

    name: str
    tried: tuple[ScoredHypothesis, ...]
    log_evidence: float
    log_mimic: float
    log_prior: float
    mimic_odds: float

    @property
    def best(self) -> ScoredHypothesis:
        return self.tried[0]

    @property
    def flexible(self) -> bool:
        return self.best.hypothesis.flexible

    @property
    def effects(self) -> int:
        return len(self.best.hypothesis.effects)


def families(tried: Sequence[ScoredHypothesis], variants: dict[str, int]) -> tuple[Family, ...]:
    """The families of what was tried, each with its prior, the likeliest first.

    `variants` says how many variants each effect has; those of a pair that were not tried count as
    if they had no evidence, and so does a pair that was not tried at all.
    """
    kinds: dict[tuple[tuple[str, ...], bool], list[ScoredHypothesis]] = {}
    for each in tried:
        names = tuple(sorted(name for name, _ in each.hypothesis.effects))
        kinds.setdefault((names, each.hypothesis.flexible), []).append(each)
    made = [_family(members, variants) for members in kinds.values()]
    return tuple(sorted(made, key=lambda each: -(each.log_evidence + each.log_prior)))


def probabilities(candidates: Sequence[Family], p_value: float = 1.0) -> tuple[FloatArray, float]:
    """Of each family, (families,), and of something unknown that passes for one of them.

    All add to 1. `p_value` is that of the likeliest family without something unknown: an effect
    that errs in its law may be given what it does not explain, while the flexible remainder pays
    for every form that it could take, so of a bad fit the evidence alone says too little.
    """
    evidence, mimic, prior, odds = (
        np.array([getattr(each, name) for each in candidates])
        for name in ("log_evidence", "log_mimic", "log_prior", "mimic_odds")
    )
    bad = misfit_odds(p_value)
    mimics = CALIBRATION.mimics_one + CALIBRATION.mimics_two
    kept = np.array([bad * (1 - mimics) if each.flexible else 1.0 for each in candidates])
    top = float((evidence + prior).max())
    weight = kept * np.exp(evidence + prior - top)
    unknown = bad * float(np.sum(odds * np.exp(mimic + prior - top)))
    whole = weight.sum() + unknown
    return np.asarray(weight / whole), unknown / whole


def misfit_odds(p_value: float) -> float:
    """By how much a p-value raises the odds of something unknown, from 1.

    Where the likeliest explanation is right, so small a p-value is that much rarer than where
    something else is, at most: -1 / (e p ln p) (Sellke, Bayarri and Berger, Am. Stat. 55, 2001).
    """
    p = max(p_value, LEAST_P_VALUE)
    return max(1.0, -1 / (np.e * p * np.log(p))) if p < 1 / np.e else 1.0


def undetected_share(candidates: Sequence[Family], chances: FloatArray) -> FloatArray:
    """Chances (families,) by which a remainder rules out no cause beyond what may be missed.

    Of what the causes gain, each has its share by what speaks for it: it was tried near its best.
    """
    unknown = np.array([each.flexible for each in candidates])
    cause = np.array([each.effects > 0 for each in candidates]) & ~unknown
    least = CALIBRATION.undetected_share * chances[unknown | cause].sum()
    if not cause.any() or chances[cause].sum() >= least:
        return chances
    speaks = np.array([each.log_evidence + each.log_prior for each in candidates])
    share = np.exp(np.where(cause, speaks - scipy.special.logsumexp(speaks[cause]), -np.inf))
    left = (chances[unknown | cause].sum() - least) / chances[unknown].sum()
    return np.asarray(np.where(cause, least * share, chances * np.where(unknown, left, 1)))


def log_prior(hypothesis: Hypothesis, variants: dict[str, int]) -> float:
    """Of a hypothesis with its variant: its family's, shared evenly by the family's variants."""
    shared = np.prod([variants[name] for name, _ in hypothesis.effects] or [1])
    return float(np.log(_prior(hypothesis, len(variants)) / shared))


def _family(members: Sequence[ScoredHypothesis], variants: dict[str, int]) -> Family:
    ordered = tuple(sorted(members, key=lambda each: -each.log_evidence))
    hypothesis = ordered[0].hypothesis
    possible = np.prod([variants[name] for name, _ in hypothesis.effects] or [1])
    evidence = [each.log_evidence for each in ordered]
    mimic = [e.log_evidence if e.log_mimic is None else e.log_mimic for e in ordered]
    log_evidence, log_mimic = (
        float(scipy.special.logsumexp(each) - np.log(possible)) for each in (evidence, mimic)
    )
    log_prior = float(np.log(_prior(hypothesis, len(variants))))
    odds = _mimic_odds(hypothesis, variants)
    return Family(hypothesis.name, ordered, log_evidence, log_mimic, log_prior, odds)


def _mimic_odds(hypothesis: Hypothesis, catalogue: Collection[str]) -> float:
    names = [name for name, _ in hypothesis.effects]
    if hypothesis.flexible or not names:
        return 0.0
    if len(names) == 1:
        return CALIBRATION.mimics_one * UNKNOWN / SINGLE
    return CALIBRATION.mimics_two * UNKNOWN / PAIR * imitation(names, catalogue)


def _prior(hypothesis: Hypothesis, effects: int) -> float:
    count = len(hypothesis.effects)
    if count == 0:
        return UNKNOWN if hypothesis.flexible else NO_GAP
    known = SINGLE / effects if count == 1 else PAIR / max(1, effects * (effects - 1) // 2)
    return AND_UNKNOWN * known if hypothesis.flexible else known


def imitation(effects: Collection[str], catalogue: Collection[str]) -> float:
    """How often something unknown passes for this pair, to the mean over pairs of `catalogue`.

    Some effects can act anywhere and take many forms: a mass and a loss of section together come
    near to almost anything. Others can do one thing only. So of what passes for a pair, a few pairs
    have the most: each as the product of what its effects were seen to do in blind trials.
    """
    pair, names = frozenset(effects), frozenset(catalogue)
    if (freedoms := _sum_of_freedoms(names)) == 0:
        return 1.0
    pairs = len(names) * (len(names) - 1) / 2
    turned = _with_turned_sensors(names)
    known = (1 - sum(turned.values())) * _freedom(pair) / freedoms + turned.get(pair, 0.0)
    return EVEN + (1 - EVEN) * known * pairs


def _with_turned_sensors(names: frozenset[str]) -> dict[frozenset[str], float]:
    """Skewed principal axes do what turned sensors do with ends that yield in one plane."""
    led, of = CALIBRATION.with_turned_sensors, CALIBRATION.mimicking_pairs
    pairs = {frozenset((_SENSORS, end)): count / of for end, count in led.items()}
    return {pair: share for pair, share in pairs.items() if pair <= names}


def _freedom(pair: Collection[str]) -> int:
    one, other = pair
    led = CALIBRATION.in_mimicking_pairs
    return led.get(one, 0) * led.get(other, 0)


@cache
def _sum_of_freedoms(names: frozenset[str]) -> int:
    return sum(_freedom(pair) for pair in combinations(names, 2))
