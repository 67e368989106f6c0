"""From evidences to probabilities: priors over families of effects, evidence averaged over places.

A family (one effect, wherever it may act) has the same prior however many variants it has, so that
an effect does not become likelier by being tried in more places (Scott and Berger, Ann. Stat. 38,
2010).

How freely each pair of effects imitates what is not in the catalogue.

Some effects can act anywhere and take many forms: a mass and a loss of section together come near
to almost anything. Others can do one thing only. So of what passes for a pair, a few pairs have
the most: each as the product of what its effects were seen to do in blind trials.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np
from scipy.special import logsumexp

from shm.gap.contract import Fit, Hypothesis, Method
from shm.values import FloatArray

NO_GAP = 0.25
SINGLE = 0.5
PAIR = 0.125
UNKNOWN = 0.125
"""Before any data: half of the hangers have one effect, a quarter none."""
AND_UNKNOWN = PAIR / (SINGLE + PAIR) * UNKNOWN / (SINGLE + UNKNOWN)
"""How often something unknown comes with an effect or a pair, to how often these come alone: as
often as a second cause comes at all, and as seldom as a cause is unknown."""

PASSES_FOR_ONE, PASSES_FOR_PAIR = 0.5, 0.2
PASSES_FOR_NONE = 1 - PASSES_FOR_ONE - PASSES_FOR_PAIR
"""Of what is not in the catalogue so much does to data about what one of its effects does, or two,
or resembles nothing in it: as effects do that are left out of the catalogue, in blind trials."""

MISSED = 0.2
"""Where a free remainder explains what no cause does, so likely is a cause nevertheless: its place
was not found, or its law is farther off than allowed for. In blind trials 20 of 56 such answers."""

LEAST_P_VALUE = 1e-4
"""Of smaller ones no more is known than that they are small: tails are not that normal."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A hypothesis with its evidence; `fit` is None where screening was enough.

    `log_passing` is the log evidence of something unknown that passes for its effects, None where
    their laws were not looked at. `draws` (n, d) are of the posterior by all laws.
    `log_fit` is the log likelihood at its best, less what the baseline's own parameters and the
    bar's deviations pay there for lying off their priors: a baseline that fits by an unlikely bar
    fits less well.
    """

    hypothesis: Hypothesis
    log_evidence: float
    log_fit: float
    fit: Fit | None = None
    log_passing: float | None = None
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
    def fitted(cls, fit: Fit, common: int) -> Tried:
        """Of a fit whose first `common` parameters are those of the baseline and the bar."""
        unlikely = float(np.sum(fit.z[:common] ** 2)) / 2
        return cls(fit.hypothesis, fit.log_evidence, fit.log_fit - unlikely, fit)


@dataclass(frozen=True, eq=False)
class Family:
    """What was tried of one effect, or one pair, wherever it may act, the best first.

    `log_passing` is the log evidence of something unknown that passes for it, `passing_odds` the
    odds of that against the family itself, before any data.
    """

    name: str
    tried: tuple[Tried, ...]
    log_evidence: float
    log_passing: float
    log_prior: float
    passing_odds: float

    @property
    def best(self) -> Tried:
        return self.tried[0]

    @property
    def flexible(self) -> bool:
        return self.best.hypothesis.flexible

    @property
    def effects(self) -> int:
        return len(self.best.hypothesis.effects)


def families(tried: Sequence[Tried], variants: dict[str, int]) -> tuple[Family, ...]:
    """The families of what was tried, each with its prior, the likeliest first.

    `variants` says how many variants each effect has; those of a pair that were not tried count as
    if they had no evidence, and so does a pair that was not tried at all.
    """
    kinds: dict[tuple[tuple[str, ...], bool], list[Tried]] = {}
    for each in tried:
        names = tuple(sorted(name for name, _ in each.hypothesis.effects))
        kinds.setdefault((names, each.hypothesis.flexible), []).append(each)
    made = [_family(members, variants) for members in kinds.values()]
    return tuple(sorted(made, key=lambda each: -(each.log_evidence + each.log_prior)))


def probabilities(candidates: Sequence[Family]) -> tuple[FloatArray, float]:
    """Of each family, (families,), and of something unknown that passes for one of them.

    All add to 1.
    """
    evidence, passing, prior, odds = (
        np.array([getattr(each, name) for each in candidates])
        for name in ("log_evidence", "log_passing", "log_prior", "passing_odds")
    )
    kept = np.array([PASSES_FOR_NONE if each.flexible else 1.0 for each in candidates])
    top = float((evidence + prior).max())
    weight = kept * np.exp(evidence + prior - top)
    unknown = float(np.sum(odds * np.exp(passing + prior - top)))
    whole = weight.sum() + unknown
    return np.asarray(weight / whole), unknown / whole


def misfit_odds(p_value: float) -> float:
    """By how much a p-value raises the odds of something unknown, from 1.

    Where the likeliest explanation is right, so small a p-value is that much rarer than where
    something else is, at most: -1 / (e p ln p) (Sellke, Bayarri and Berger, Am. Stat. 55, 2001).
    """
    p = max(p_value, LEAST_P_VALUE)
    return max(1.0, -1 / (np.e * p * np.log(p))) if p < 1 / np.e else 1.0


def doubted(
    candidates: Sequence[Family], chances: FloatArray, passing: float, p_value: float
) -> tuple[FloatArray, float]:
    """Chances (families,) and `passing`, once the likeliest explanation fits no better than that.

    An effect that errs in its law may be given what it does not explain; the flexible remainder
    pays for every form that it could take. So of a bad fit the evidence says too little.
    """
    unknown = np.array([each.flexible for each in candidates])
    odds = misfit_odds(p_value)
    weight, passing = chances * np.where(unknown, odds, 1.0), passing * odds
    whole = float(weight.sum() + passing)
    return np.asarray(weight / whole), passing / whole


def missed(candidates: Sequence[Family], chances: FloatArray) -> FloatArray:
    """Chances (families,) by which a remainder rules out no cause beyond what may be missed.

    Of what the causes gain, each has its share by what speaks for it: it was tried near its best.
    """
    unknown = np.array([each.flexible for each in candidates])
    cause = np.array([each.effects > 0 for each in candidates]) & ~unknown
    of_both = chances[unknown | cause].sum()
    if not cause.any() or chances[cause].sum() >= MISSED * of_both:
        return chances
    speaks = np.array([each.log_evidence + each.log_prior for each in candidates])
    share = np.exp(np.where(cause, speaks - logsumexp(speaks[cause]), -np.inf))
    left = (1 - MISSED) * of_both / chances[unknown].sum()
    return np.asarray(
        np.where(cause, MISSED * of_both * share, chances * np.where(unknown, left, 1))
    )


def log_prior(hypothesis: Hypothesis, variants: dict[str, int]) -> float:
    """Of a hypothesis with its variant: its family's, shared evenly by the family's variants."""
    shared = np.prod([variants[name] for name, _ in hypothesis.effects] or [1])
    return float(np.log(_prior(hypothesis, len(variants)) / shared))


def _family(members: Sequence[Tried], variants: dict[str, int]) -> Family:
    ordered = tuple(sorted(members, key=lambda each: -each.log_evidence))
    hypothesis = ordered[0].hypothesis
    possible = np.prod([variants[name] for name, _ in hypothesis.effects] or [1])
    evidence = [each.log_evidence for each in ordered]
    passing = [e.log_evidence if e.log_passing is None else e.log_passing for e in ordered]
    log_evidence, log_passing = (
        float(logsumexp(each) - np.log(possible)) for each in (evidence, passing)
    )
    log_prior = float(np.log(_prior(hypothesis, len(variants))))
    odds = _passing_odds(hypothesis, variants)
    return Family(hypothesis.name, ordered, log_evidence, log_passing, log_prior, odds)


def _passing_odds(hypothesis: Hypothesis, catalogue: Collection[str]) -> float:
    names = [name for name, _ in hypothesis.effects]
    if hypothesis.flexible or not names:
        return 0.0
    if len(names) == 1:
        return PASSES_FOR_ONE * UNKNOWN / SINGLE
    return PASSES_FOR_PAIR * UNKNOWN / PAIR * imitation(names, catalogue)


def _prior(hypothesis: Hypothesis, effects: int) -> float:
    count = len(hypothesis.effects)
    if count == 0:
        return UNKNOWN if hypothesis.flexible else NO_GAP
    known = SINGLE / effects if count == 1 else PAIR / max(1, effects * (effects - 1) // 2)
    return AND_UNKNOWN * known if hypothesis.flexible else known


LED_FALSELY = {
    "point_mass": 45,
    "section_loss": 42,
    "intermediate_support": 38,
    "stiff_end_zones": 31,
    "effective_length": 27,
    "rotational_end_flexibility": 27,
    "sag": 16,
    "support_motion": 16,
    "bending_stiffness": 12,
    "shear_and_rotary_inertia": 12,
    "translational_end_flexibility": 10,
    "distributed_mass": 8,
    "timebase": 6,
    "skewed_principal_axes": 1,
    "temperature_tension": 1,
}
"""In how many of 146 pairs that led in blind trials each effect was, where the true effect had been
taken out of the catalogue."""

SENSORS = "sensor_misalignment"
LED_WITH_TURNED_SENSORS = {
    "rotational_end_flexibility": 19 / 168,
    "stiff_end_zones": 2 / 168,
    "translational_end_flexibility": 1 / 168,
}
"""Principal axes that are skewed do what turned sensors and ends that yield in one plane do: of all
such cases, in how many turned sensors led with each."""

EVEN = 0.2
"""So much is shared evenly by all pairs: what is unknown need not resemble the catalogue's effects,
from which the counts are."""


def imitation(effects: Collection[str], catalogue: Collection[str]) -> float:
    """How often something unknown passes for this pair, to the mean over pairs of `catalogue`."""
    pair, names = frozenset(effects), frozenset(catalogue)
    if (freedoms := _sum_of_freedoms(names)) == 0:
        return 1.0
    pairs = len(names) * (len(names) - 1) / 2
    turned = _with_turned_sensors(names)
    known = (1 - sum(turned.values())) * _freedom(pair) / freedoms + turned.get(pair, 0.0)
    return EVEN + (1 - EVEN) * known * pairs


def _with_turned_sensors(names: frozenset[str]) -> dict[frozenset[str], float]:
    pairs = {frozenset((SENSORS, end)): led for end, led in LED_WITH_TURNED_SENSORS.items()}
    return {pair: led for pair, led in pairs.items() if pair <= names}


def _freedom(pair: Collection[str]) -> int:
    one, other = pair
    return LED_FALSELY.get(one, 0) * LED_FALSELY.get(other, 0)


@cache
def _sum_of_freedoms(names: frozenset[str]) -> int:
    return sum(_freedom(pair) for pair in combinations(names, 2))
