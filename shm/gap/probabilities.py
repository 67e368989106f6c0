"""From evidences to probabilities: Bayes' rule.

    P(h | data) ~ prior(h) x evidence(h)

Hypotheses h are families (one effect or pair, wherever it may act), each with or without something
unknown beside it, and something unknown that passes for a family. A family has the same prior
however many variants it has, so that an effect does not become likelier by being tried in more
places (Scott and Berger, Ann. Stat. 38, 2010); its evidence is the mean over them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.gap.calibration import CALIBRATION
from shm.gap.contract import Fit, Hypothesis, Method
from shm.values import FloatArray

# Before any data, judgement: who asks for a diagnosis mostly has a gap, and one cause is commoner
# than two. Trials plant the same mix; where it is another, odds are off by the ratio.
NO_GAP = 0.25
SINGLE = 0.5
PAIR = 0.125
UNKNOWN = 0.125

AND_UNKNOWN = PAIR / (SINGLE + PAIR) * UNKNOWN / (SINGLE + UNKNOWN)
"""How often something unknown comes with an effect or a pair, to how often these come alone: as
often as a second cause comes at all, and as seldom as a cause is unknown."""


@dataclass(frozen=True, eq=False)
class ScoredHypothesis:
    """A hypothesis with its evidence; `fit` is None where a scan or a climb was enough.

    `log_mimic` is the log evidence of something unknown that passes for its effects, None where
    their laws were not looked at. `draws` (n, d) are of the posterior by all laws.
    `log_fit` is the log likelihood at its best, less what the hanger's own parameters pay there for
    lying off their priors: a hanger that fits by an unlikely bar fits less well.
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
        """Of a fit whose first `common` parameters are those of the hanger."""
        unlikely = float(np.sum(fit.z[:common] ** 2)) / 2
        return cls(fit.hypothesis, fit.log_evidence, fit.log_fit - unlikely, fit)


@dataclass(frozen=True, eq=False)
class Family:
    """One effect, or one pair, wherever it may act; what was tried of it, the best first.

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
    """Return the families of what was tried, each with its prior, the likeliest first.

    `variants` says how many variants each effect has; those of a pair that were not tried count as
    if they had no evidence, and so does a pair that was not tried at all.
    """
    kinds: dict[tuple[tuple[str, ...], bool], list[ScoredHypothesis]] = {}
    for each in tried:
        names = tuple(sorted(each.hypothesis.names))
        kinds.setdefault((names, each.hypothesis.flexible), []).append(each)
    made = [_family(members, variants) for members in kinds.values()]
    return tuple(sorted(made, key=lambda each: -(each.log_evidence + each.log_prior)))


def probabilities(candidates: Sequence[Family]) -> tuple[FloatArray, float]:
    """Return that of each family, (families,), and of something unknown that passes for one.

    All add to 1.
    """
    evidence, mimic, prior, odds = (
        np.array([getattr(each, name) for each in candidates])
        for name in ("log_evidence", "log_mimic", "log_prior", "mimic_odds")
    )
    resembling_nothing = 1 - CALIBRATION.mimics_one - CALIBRATION.mimics_two
    kept = np.array([resembling_nothing if each.flexible else 1.0 for each in candidates])
    top = float((evidence + prior).max())
    weight = kept * np.exp(evidence + prior - top)
    unknown = float(np.sum(odds * np.exp(mimic + prior - top)))
    whole = weight.sum() + unknown
    return np.asarray(weight / whole), unknown / whole


def log_prior(hypothesis: Hypothesis, variants: dict[str, int]) -> float:
    """Return that of a hypothesis with its variant: its family's, shared by all its variants."""
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
    odds = _mimic_odds(hypothesis)
    return Family(hypothesis.name, ordered, log_evidence, log_mimic, log_prior, odds)


def _mimic_odds(hypothesis: Hypothesis) -> float:
    if hypothesis.flexible or not hypothesis.effects:
        return 0.0
    if len(hypothesis.effects) == 1:
        return CALIBRATION.mimics_one * UNKNOWN / SINGLE
    return CALIBRATION.mimics_two * UNKNOWN / PAIR


def _prior(hypothesis: Hypothesis, effects: int) -> float:
    count = len(hypothesis.effects)
    if count == 0:
        return UNKNOWN if hypothesis.flexible else NO_GAP
    known = SINGLE / effects if count == 1 else PAIR / max(1, effects * (effects - 1) // 2)
    return AND_UNKNOWN * known if hypothesis.flexible else known
