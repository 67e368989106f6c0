"""Judge a gap diagnosis: the one decision on what it claims, which every report states."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING, Literal

from shm.values.kinds import NAN
from shm.values.leading import MIN_NO_GAP_PROBABILITY
from shm.values.posterior import ENOUGH_EFFECTIVE, MOST_MISFIT_PERCENT

if TYPE_CHECKING:
    from shm.values.diagnosis import Cause, Diagnosis, Outlier, Residual, Shrinkage

# Limits of a verdict, docs/decisions/0012-verdict.md.
MAX_RMS_Z = 2.0
MIN_FIT_P_VALUE = 0.01
MIN_LOG_BAYES_FACTOR = math.log(20.0)
MIN_CLAIM = 0.5
MIN_RUNNER_UP = 0.1
MAX_HELD_OUT = 0.8
FEW_MODES = 4
"""Below which nothing is left to disagree: tension and stiffness take two."""

DESCRIPTION_EFFECTS = (
    "bending_stiffness",
    "section_size",
    "distributed_mass",
    "effective_length",
)
"""Effects of the catalogue that say no more than that the description is wrong."""


class Outcome(Enum):
    """Name the five outcomes of a diagnosis."""

    NO_GAP = "No gap visible"
    EXPLAINED = "Explained"
    PARTLY = "Partly explained"
    ALIKE = "Several causes fit alike"
    UNEXPLAINED = "Not explained"


Reason = Literal[
    "",
    # no gap visible
    "few modes",
    "misses by percents",
    "misses the errors",
    "less probable than not",
    # partly or not explained
    "poor fit",
    "large residuals",
    "large misfit",
    "acts alone",
    "unknown is more probable",
    "much would fit",
    "weak evidence",
    "none is more probable than not",
    "sampler failed",
    "no probabilities",
]
DOUBTFUL = "Doubtful"
"""How a remark begins that doubts of which hanger the tests are."""
SHAPES_OFF = "Mode shapes are off"
"""How a remark begins where the shapes alone make the fit poor."""
_UNKNOWN: Reason = "unknown is more probable"


@dataclass(frozen=True)
class Claim:
    """One cause, or the causes that the data cannot tell apart, most probable first."""

    causes: tuple[Cause, ...]

    @property
    def probability(self) -> float:
        """Return the probability that it is one of them."""
        return sum(cause.probability for cause in self.causes)

    @property
    def leading(self) -> Cause:
        """Return the most probable of them."""
        return self.causes[0]

    @property
    def log_bayes_factor(self) -> float:
        """Return the largest evidence of any of them against no gap."""
        return max(cause.log_bayes_factor for cause in self.causes)

    @property
    def is_description_off(self) -> bool:
        """Return whether it may be no more than a wrong description."""
        names = {effect for cause in self.causes for effect in cause.effects}
        return not names.isdisjoint(DESCRIPTION_EFFECTS)


@dataclass(frozen=True)
class GapVerdict:
    """State what a diagnosis claims: outcome, reason for what is open, and the causes it names.

    `probability` is that of the claim, of no gap, or of something unknown. `rms_z` is the root mean
    square of what is left, in standard deviations of the stated errors (NaN without any).
    It `is_doubted` where the tests may be of another hanger than the described one.
    `runner_up` is the most probable cause where none is claimed. `alone` is the excluded frequency
    that may be no blunder, but something that acts on one mode alone. `holds_out` is False if
    frequencies that were held out of the fit come no nearer with the claim, None if none were.
    """

    outcome: Outcome
    probability: float
    rms_z: float
    fit_p_value: float
    reason: Reason = ""
    claim: Claim | None = None
    runner_up: Claim | None = None
    alone: Outlier | None = None
    is_within_errors: bool = True
    is_uncertain: bool = False
    is_doubted: bool = False
    is_few: bool = False
    holds_out: bool | None = None

    @property
    def is_description_off(self) -> bool:
        """Return whether calliper and tape come first."""
        return self.claim is not None and self.claim.is_description_off

    @property
    def is_open(self) -> bool:
        """Return whether something remains that no claim covers."""
        return self.is_uncertain or self.outcome in (Outcome.PARTLY, Outcome.UNEXPLAINED)


def judge(diagnosis: Diagnosis) -> GapVerdict:
    """Return the verdict of a diagnosis, from its numbers alone."""
    alone = max(diagnosis.outliers, key=lambda each: each.acts_alone, default=None)
    if alone is not None and not alone.acts_alone >= MIN_NO_GAP_PROBABILITY:
        alone = None
    found = GapVerdict(
        Outcome.UNEXPLAINED,
        diagnosis.unexplained_probability,
        _rms_z(diagnosis, "after_z"),
        diagnosis.fit_p_value,
        alone=alone,
        is_uncertain=diagnosis.effective_draws < ENOUGH_EFFECTIVE,
        is_doubted=any(each.startswith(DOUBTFUL) for each in diagnosis.remarks),
        is_few=len({(each.plane, each.order) for each in diagnosis.where}) < FEW_MODES,
        holds_out=_holds_out(diagnosis.shrinkage),
    )
    if not diagnosis.no_gap_probability >= MIN_NO_GAP_PROBABILITY:
        return _judge_gap(diagnosis, found)
    found = replace(found, rms_z=_rms_z(diagnosis, "z"))
    doubt = _doubt_no_gap(diagnosis, found)
    found = replace(found, is_within_errors=not doubt.startswith("misses"))
    if alone is not None:
        return replace(found, reason="acts alone", probability=alone.acts_alone)
    unknown_leads = diagnosis.unexplained_probability > diagnosis.no_gap_probability
    if unknown_leads and not found.is_within_errors:
        nearest = next(iter(group_causes(diagnosis.causes)), None)
        return _decline(diagnosis, _with_runner_up(found, nearest), nearest)
    if doubt == "less probable than not":
        found = _with_runner_up(found, next(iter(group_causes(diagnosis.causes)), None))
    return replace(
        found,
        outcome=Outcome.NO_GAP,
        probability=diagnosis.no_gap_probability,
        reason=doubt,
    )


def group_causes(causes: Iterable[Cause]) -> tuple[Claim, ...]:
    """Return the causes, those of a group together, most probable first."""
    together: dict[str, list[Cause]] = {}
    for cause in sorted(causes, key=lambda cause: -cause.probability):
        key = cause.effect if cause.group is None else f"group {cause.group}"
        together.setdefault(key, []).append(cause)
    found = [Claim(tuple(each)) for each in together.values()]
    return tuple(sorted(found, key=lambda claim: -claim.probability))


def is_excluded(diagnosis: Diagnosis, residual: Residual) -> bool:
    """Return whether a frequency was excluded as a gross error."""
    named = [(each.plane, each.order, each.test) for each in diagnosis.outliers]
    return (residual.plane, residual.order, residual.test) in named


def _judge_gap(diagnosis: Diagnosis, found: GapVerdict) -> GapVerdict:
    """Return the verdict where no gap is ruled out."""
    left = _find_left(diagnosis, found)
    found = replace(found, is_within_errors=left in ("", "acts alone"))
    claims = group_causes(diagnosis.causes)
    nearest = next(iter(claims), None)
    if nearest is None or math.isnan(nearest.probability):
        known = math.isfinite(diagnosis.unexplained_probability)
        return replace(found, reason=_UNKNOWN if known else "no probabilities")
    found = _with_runner_up(found, nearest)
    if found.is_uncertain:
        return replace(found, reason="sampler failed")
    if left:
        is_worth_naming = nearest.probability >= MIN_RUNNER_UP
        is_strong = nearest.log_bayes_factor > MIN_LOG_BAYES_FACTOR
        if is_worth_naming and is_strong and _explains_some(diagnosis, left):
            return _with_claim(found, Outcome.PARTLY, nearest, left)
        return _decline(diagnosis, found, nearest)
    if diagnosis.leading is None:
        is_behind = diagnosis.unexplained_probability >= nearest.probability
        is_weak = not nearest.log_bayes_factor > MIN_LOG_BAYES_FACTOR
        return replace(found, reason=_UNKNOWN if is_weak and is_behind else "much would fit")
    claim = _join(claims)
    if not claim.probability >= MIN_CLAIM:
        return replace(found, reason="none is more probable than not")
    outcome = Outcome.EXPLAINED if len(claim.causes) == 1 else Outcome.ALIKE
    return _with_claim(found, outcome, claim)


def _with_runner_up(found: GapVerdict, nearest: Claim | None) -> GapVerdict:
    """Return the verdict with the most probable claim, where that is worth naming."""
    is_worth_naming = nearest is not None and nearest.probability >= MIN_RUNNER_UP
    return replace(found, runner_up=nearest) if is_worth_naming else found


def _decline(diagnosis: Diagnosis, found: GapVerdict, nearest: Claim | None) -> GapVerdict:
    """Return the verdict that claims nothing of data which leave more than the errors allow."""
    is_behind = nearest is None or diagnosis.unexplained_probability >= nearest.probability
    is_unknown = diagnosis.leading is None and is_behind
    return replace(found, reason=_UNKNOWN if is_unknown else "weak evidence")


def _with_claim(
    found: GapVerdict, outcome: Outcome, claim: Claim, reason: Reason = ""
) -> GapVerdict:
    return replace(
        found,
        outcome=outcome,
        probability=claim.probability,
        reason=reason,
        claim=claim,
        runner_up=None,
    )


def _join(claims: Sequence[Claim]) -> Claim:
    """Return the most probable claims that together are more probable than all else."""
    causes: tuple[Cause, ...] = ()
    for each in claims:
        causes += each.causes
        if Claim(causes).probability >= MIN_CLAIM:
            break
    return Claim(causes)


def _find_left(diagnosis: Diagnosis, found: GapVerdict) -> Reason:
    """Return what shows that more is left than the errors allow; empty if nothing does."""
    if found.rms_z > MAX_RMS_Z:
        return "large residuals"
    misfit_percent = diagnosis.shrinkage.rms_after_percent
    if math.isnan(found.rms_z) and misfit_percent > MOST_MISFIT_PERCENT:
        return "large misfit"  # without stated errors: more than a sound model leaves
    if not found.fit_p_value >= MIN_FIT_P_VALUE:
        return "poor fit"
    return "acts alone" if found.alone else ""


def _explains_some(diagnosis: Diagnosis, left: Reason) -> bool:
    """Return whether frequencies that are off come nearer with the leading cause."""
    shrinkage = diagnosis.shrinkage
    is_nearer = shrinkage.rms_after_percent < shrinkage.rms_before_percent
    return is_nearer or left not in ("large residuals", "large misfit")


def _doubt_no_gap(diagnosis: Diagnosis, found: GapVerdict) -> Reason:
    """Return why a hanger without a visible gap is not called explained; empty if it is."""
    if diagnosis.shrinkage.rms_before_percent > MOST_MISFIT_PERCENT:
        return "misses by percents"
    if found.rms_z > MAX_RMS_Z or found.fit_p_value < MIN_FIT_P_VALUE:
        return "misses the errors"
    if found.is_few:
        return "few modes"
    return "" if diagnosis.no_gap_probability >= MIN_CLAIM else "less probable than not"


def _holds_out(shrinkage: Shrinkage) -> bool | None:
    before, after = shrinkage.held_out_before_percent, shrinkage.held_out_after_percent
    return after <= MAX_HELD_OUT * before if math.isfinite(before + after) else None


def _rms_z(diagnosis: Diagnosis, field: Literal["z", "after_z"]) -> float:
    """Return the root mean square of the standardised residuals that were not excluded."""
    values = [getattr(r, field) for r in diagnosis.where if not is_excluded(diagnosis, r)]
    known = [value for value in values if math.isfinite(value)]
    return math.hypot(*known) / math.sqrt(len(known)) if known else NAN
