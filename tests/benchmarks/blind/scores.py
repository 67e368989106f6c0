"""Score answers next to their truth. One that failed or is missing counts as wrong everywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.errors import BadInput
from shm.values import Cause, Diagnosis, FloatArray
from shm.values.diagnosis import joined
from tests.benchmarks.blind.truth import Answer, CaseScore, TrueCase

SURE = 0.9
"""An effect named with more than this is a statement that somebody may act on."""
FEWEST = 10
"""Cases from which on a mark is judged."""
LARGE = 4.0
"""Standard deviations from which on a gap is asked for."""
NO_GAP, UNEXPLAINED, NOTHING = "no gap", "unexplained", "nothing"

Key = tuple[str, ...]
"""The effects of a cause in alphabetical order."""


def case_scores(truths: Sequence[TrueCase], answers: Sequence[Answer]) -> tuple[CaseScore, ...]:
    """Return the scores of the first round, in the order of the key.

    Raises BadInput for answers to cases that the key does not hold.
    """
    given = _by_case(truths, answers)
    return tuple(_first_round(truth, given.get(truth.case)) for truth in truths)


def left_out_scores(
    truths: Sequence[TrueCase], first_round: Sequence[Answer], answers: Sequence[Answer]
) -> tuple[CaseScore, ...]:
    """Return the scores of the second round, of cases from which something was left out.

    What the data cannot tell from the truth is what the answer of the first round says. Raises
    BadInput for answers to cases that the key does not hold.
    """
    before, given = _by_case(truths, first_round), _by_case(truths, answers)
    return tuple(
        _second_round(truth, before.get(truth.case), given.get(truth.case))
        for truth in truths
        if truth.left_out
    )


def _by_case(truths: Sequence[TrueCase], answers: Sequence[Answer]) -> dict[str, Answer]:
    known = {truth.case for truth in truths}
    strangers = [answer.case for answer in answers if answer.case not in known]
    if strangers:
        raise BadInput(
            f"the key holds no case {strangers[0]}, which has an answer.",
            remedy="Score a trial with the key that was made with it.",
        )
    return {answer.case: answer for answer in answers}


def _first_round(truth: TrueCase, answer: Answer | None) -> CaseScore:
    if answer is None or answer.diagnosis is None:
        return _failed(truth, answer)
    diagnosis, planted = answer.diagnosis, _planted(truth)
    right = {"none": NO_GAP, "unknown": UNEXPLAINED}.get(truth.kind, "")
    if right:
        return _scored(truth, diagnosis, right, frozenset())
    scored = _scored(truth, diagnosis, "", _group_of_truth(diagnosis, planted))
    ranked = sorted(diagnosis.causes, key=lambda cause: -cause.probability)
    true = _cause_of(diagnosis, planted)
    if true is None:
        return scored
    in_group = true.group is not None and true.group == ranked[0].group
    return replace(scored, first=true is ranked[0], in_group=true is ranked[0] or in_group)


def _second_round(truth: TrueCase, before: Answer | None, answer: Answer | None) -> CaseScore:
    if answer is None or answer.diagnosis is None:
        return _failed(truth, answer)
    group = _group_of_truth(before.diagnosis if before else None, _planted(truth))
    right = NO_GAP if truth.kind == "none" else UNEXPLAINED
    scored = _scored(truth, answer.diagnosis, right, group)
    return replace(scored, in_group=bool(_claim(answer.diagnosis).keys & group))


def _failed(truth: TrueCase, answer: Answer | None) -> CaseScore:
    why = "not answered" if answer is None else answer.failure or "no diagnosis"
    return replace(_blank(truth), failure=why)


def _blank(truth: TrueCase) -> CaseScore:
    planted = joined(effect.name for effect in truth.effects) or NOTHING
    return CaseScore(truth.case, truth.kind, truth.size, planted)


def _scored(truth: TrueCase, diagnosis: Diagnosis, right: str, group: frozenset[Key]) -> CaseScore:
    """Score what either round is asked for; without a `right` leader it is what was planted."""
    claim, tension = _claim(diagnosis), diagnosis.tension_after_n
    blames = claim.causes and claim.probability > SURE and not claim.keys & group
    return replace(
        _blank(truth),
        leader=claim.leader,
        leading_probability=claim.probability,
        right=claim.leader == right if right else _planted(truth) in claim.keys,
        tension_error_after=tension.mean / truth.tension_n - 1,
        tension_covered=bool(tension.q025 <= truth.tension_n <= tension.q975),
        misattributed=bool(blames),
        alike=tuple(each.effect for each in claim.causes if each.effect != claim.leader),
    )


@dataclass(frozen=True)
class _Claim:
    """What leads: the most probable cause with those of its group, `no gap` or `unexplained`."""

    leader: str
    probability: float
    causes: tuple[Cause, ...] = ()

    @property
    def keys(self) -> frozenset[Key]:
        return frozenset(_key(cause.effects) for cause in self.causes)


def _claim(diagnosis: Diagnosis) -> _Claim:
    leading = diagnosis.leading
    if leading is not None:
        return _Claim(leading.effect, diagnosis.claim(leading), _group(diagnosis, leading))
    if diagnosis.leads == NO_GAP:
        return _Claim(NO_GAP, diagnosis.no_gap_probability)
    return _Claim(UNEXPLAINED, diagnosis.unexplained_probability)


def _group(diagnosis: Diagnosis, cause: Cause) -> tuple[Cause, ...]:
    if cause.group is None:
        return (cause,)
    return tuple(each for each in diagnosis.causes if each.group == cause.group)


def _key(effects: Sequence[str]) -> Key:
    return tuple(sorted(effects))


def _planted(truth: TrueCase) -> Key:
    return _key([effect.name for effect in truth.effects])


def _cause_of(diagnosis: Diagnosis, effects: Key) -> Cause | None:
    """Return the cause that is these effects and no other; None where it was not tried."""
    return next((each for each in diagnosis.causes if _key(each.effects) == effects), None)


def _group_of_truth(diagnosis: Diagnosis | None, effects: Key) -> frozenset[Key]:
    """Return what these data cannot tell from what was planted; of two effects also from each."""
    planted = {effects, *((effect,) for effect in effects)}
    found = set(planted)
    for each in planted:
        cause = _cause_of(diagnosis, each) if diagnosis is not None else None
        if diagnosis is not None and cause is not None:
            found |= {_key(other.effects) for other in _group(diagnosis, cause)}
    return frozenset(found)


def leading(case: CaseScore) -> float:
    """Return the leading probability; a failure counts as a sure answer that is wrong."""
    return 1.0 if case.failure else case.leading_probability


# Judgement: a share of 15 errs by up to 0.13 (1 sd); ten bins are what a reliability curve shows.
_IN_A_BIN, _MOST_BINS = 15, 10
_RESAMPLES = 1000  # technical: 2.5 % quantiles of 1000 draws err by 0.5 %


def bins_of(cases: int) -> int:
    """Return how many bins: at least 15 cases in each, ten at most."""
    return max(1, min(_MOST_BINS, cases // _IN_A_BIN))


def calibration_error(probability: FloatArray, right: FloatArray, axis: int = -1) -> FloatArray:
    """Return the expected calibration error over bins of equal counts, of samples (..., cases).

    The mean over the bins of how far the mean probability lies from the fraction that is right
    (Naeini, Cooper and Hauskrecht 2015; equal counts: Nguyen and O'Connor 2015).
    """
    probability, right = (np.moveaxis(each, axis, -1) for each in (probability, right))
    order = np.argsort(probability, axis=-1, kind="stable")
    excess = np.take_along_axis(probability - right, order, axis=-1)
    parts = np.array_split(excess, bins_of(excess.shape[-1]), axis=-1)
    off = np.stack([np.abs(part.sum(axis=-1)) for part in parts])
    return np.asarray(off.sum(axis=0) / excess.shape[-1])


def corrected_calibration_error(
    probability: FloatArray, right: FloatArray, rng: np.random.Generator
) -> tuple[float, tuple[float, float]]:
    """Return the calibration error less its bias, with its 95 % bootstrap interval.

    Few cases scatter about a perfect diagonal too, and all scatter counts as error: by the mean of
    the bootstrap the counted error lies too high (Efron and Tibshirani 1993, 10.2; of this error
    Kumar, Liang and Ma 2019). Nothing lies below 0.
    """
    counted = float(calibration_error(probability, right))
    if len(probability) < 2:
        return counted, (counted, counted)
    statistic: Callable[..., FloatArray] = calibration_error
    draws = scipy.stats.bootstrap(
        (probability, right), statistic, n_resamples=_RESAMPLES, paired=True, vectorized=True,
        method="percentile", rng=rng,
    ).bootstrap_distribution  # fmt: skip
    low, high = np.quantile(np.maximum(0.0, 2 * counted - draws), [0.025, 0.975])
    return max(0.0, 2 * counted - float(draws.mean())), (float(low), float(high))
