"""From evidences to probabilities: Bayes' rule.

    P(h | data) ~ prior(h) x evidence(h)

Hypotheses h are families (one effect or pair, wherever it may act), each with or without something
unknown beside it, and something unknown that passes for a family. A family has the same prior
however many variants it has, so that an effect does not become likelier by being tried in more
places (Scott and Berger, Ann. Stat. 38, 2010); its evidence is the mean over them.

Trials taught two corrections after the evidence (`calibration.toml`, which
`tests/benchmarks/gap_calibration.py` writes). An effect's law may be off: corrosion has no edges,
sockets taper, joints slip by another power. So the data may err about a prediction by an unknown
fraction of what the effect does beyond what the hanger alone can follow, the same in all tests:
from mode to mode, or smoothly over the orders. And a share of what is not in the catalogue passes
for an effect or a pair of it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Fit, Hypothesis, Method
from shm.gap.hypotheses.noise import same_mode, smooth_over_orders
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.sampling import Lobes
from shm.gap.hypotheses.target import Target
from shm.inference.sampler.likelihood import Covariance, Likelihood
from shm.inference.sampler.mixture import normalised
from shm.values import FloatArray

FILE = Path(__file__).with_name("calibration.toml")


class Share(NamedTuple):
    """Probabilities that a known effect's law is off by so much, and that of something unknown."""

    known: float
    unknown: float


@dataclass(frozen=True)
class Calibration:
    """The values, each explained in the file.

    `mimics_one` and `mimics_two` are shares of what is not in the catalogue; `exact` and `off_by`
    (by fraction) add to 1.
    """

    mimics_one: float
    mimics_two: float
    exact: Share
    off_by: Mapping[float, Share]


def read_calibration(file: Path = FILE) -> Calibration:
    """Return the values of a file that `tests/benchmarks/gap_calibration.py` has written."""
    document = tomllib.loads(file.read_text(encoding="utf-8"))
    mimic, law = document["mimic"], document["law"]
    return Calibration(
        mimics_one=mimic["one_effect"],
        mimics_two=mimic["two_effects"],
        exact=Share(**law["exact"]),
        off_by={each["fraction"]: Share(each["known"], each["unknown"]) for each in law["off"]},
    )


CALIBRATION = read_calibration()


@dataclass(frozen=True, eq=False)
class ByLaws:
    """A fit with effects whose laws may be off.

    `gain` is the gain of its log evidence, `mimic` the gain were it something unknown that passes
    for the effects. `draws` (n, d) are of the posterior by all laws.
    """

    gain: float
    mimic: float
    draws: FloatArray


def allow_for_laws(
    problem: GapProblem, baseline: Fit, fit: Fit, rng: np.random.Generator
) -> ByLaws:
    """Return what a fit gains where its effects' laws may be off, all about it taken as linear."""
    residual = problem.value - fit.predicted
    ways = [(CALIBRATION.exact, fit.noise), *_allowances(problem, baseline, fit)]
    found = [_linear(fit, errors, residual) for _, errors in ways]
    log = np.array([each for each, *_ in found]) - found[0][0]
    log_known, unknown = (
        np.log([getattr(share, name) for share, _ in ways]) + log for name in Share._fields
    )
    chosen = rng.choice(len(ways), size=len(fit.draws), p=normalised(log_known))
    draws = fit.draws.copy()
    lobes = Lobes(Target(problem, fit.hypothesis), fit.peaks)
    for way in np.unique(chosen[chosen > 0]):
        rows = np.flatnonzero(chosen == way)
        _, step, inner = found[way]
        normal = rng.standard_normal((len(rows), len(fit.z)))
        about = fit.z + step + np.linalg.solve(np.linalg.cholesky(inner).T, normal.T).T
        draws[rows] = lobes.spread(about, rng) if len(lobes.peaks) > 1 else about
    return ByLaws(
        float(scipy.special.logsumexp(log_known)), float(scipy.special.logsumexp(unknown)), draws
    )


def _linear(
    fit: Fit, errors: Covariance, residual: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return log evidence, step (d,) and curvature (d, d) about a fit by other errors."""
    likelihood = Likelihood.of(errors, fit.model_error)
    inner, step, *_ = likelihood.linear(fit.slopes, residual, fit.z)
    # What is left is squared anew: a difference of squares may be nothing but lost digits.
    left = likelihood.squares((residual - fit.slopes @ step)[None])[0, 0]
    misfit = left + ((fit.z + step) ** 2).sum()
    log = likelihood.log_height[0] - np.linalg.slogdet(inner)[1] / 2 - misfit / 2
    return float(log), step, inner


def _allowances(problem: GapProblem, baseline: Fit, fit: Fit) -> Iterator[tuple[Share, Covariance]]:
    design, shift = problem.design, fit.predicted - baseline.predicted
    count, patterns = design.frequencies, (same_mode(design), smooth_over_orders(design))
    for fraction, share in CALIBRATION.off_by.items():
        off = fraction * shift
        for pattern in patterns:
            errors = replace(
                fit.noise,
                frequency=fit.noise.frequency + np.outer(off[:count], off[:count]) * pattern,
                shape=fit.noise.shape + off[count:] ** 2,
            )
            yield Share(*(each / len(patterns) for each in share)), errors


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
    factor = np.array([resembling_nothing if each.flexible else 1.0 for each in candidates])
    top = float((evidence + prior).max())
    weight = factor * np.exp(evidence + prior - top)
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
