"""Each answer beside its truth. An answer that failed or is missing counts as wrong everywhere.

How well an answer predicts what it did not see, beside the truth.

What an answer claims, and what it should have claimed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import BadInput
from shm.values import (
    NAN,
    Answer,
    CaseScore,
    Cause,
    Diagnosis,
    FloatArray,
    Residual,
    TrueCase,
    TrueFrequency,
)
from shm.values.diagnosis import joined

SURE = 0.9
"""An effect named with more than this is a statement that somebody may act on."""
_WORST_BRIER = 2.0  # all given to what is wrong: 1 for that and 1 for what is right
_AMONG = 3  # judgement: who reads on reads the first three


def case_scores(truths: Sequence[TrueCase], answers: Sequence[Answer]) -> tuple[CaseScore, ...]:
    """The first round, in the order of the key.

    Raises BadInput for answers to cases that the key does not hold.
    """
    given = _by_case(truths, answers)
    return tuple(_first_round(truth, given.get(truth.case)) for truth in truths)


def left_out_scores(
    truths: Sequence[TrueCase], first_round: Sequence[Answer], answers: Sequence[Answer]
) -> tuple[CaseScore, ...]:
    """The second round, of cases from which something was left out, in the order of the key.

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
    diagnosis, right = answer.diagnosis, wanted(truth)
    group = group_of_truth(diagnosis, right.effects) if right.effects else frozenset()
    scored = _scored(truth, diagnosis, right, group)
    return _with_causes(scored, truth, diagnosis, right.effects) if right.effects else scored


def _second_round(truth: TrueCase, before: Answer | None, answer: Answer | None) -> CaseScore:
    if answer is None or answer.diagnosis is None:
        return _failed(truth, answer)
    planted = key([effect.name for effect in truth.effects])
    group = group_of_truth(before.diagnosis if before else None, planted)
    scored = _scored(truth, answer.diagnosis, wanted_without(truth), group)
    return replace(scored, in_group=bool(claimed(answer.diagnosis).keys & group))


def _failed(truth: TrueCase, answer: Answer | None) -> CaseScore:
    """Nothing was claimed and nothing was right."""
    why = "not answered" if answer is None else answer.failure or "no diagnosis"
    return replace(
        _blank(truth),
        failure=why,
        brier=_WORST_BRIER,
        tension_covered=False,
        pair_told=False if truth.kind == "two" else None,
    )


def _blank(truth: TrueCase) -> CaseScore:
    return CaseScore(
        case=truth.case,
        kind=truth.kind,
        richness=truth.richness,
        way=truth.way,
        size=truth.size,
        planted=joined(effect.name for effect in truth.effects) or NOTHING,
        leader="",
        leading_probability=0.0,
        right=False,
        detected=False,
        first=False,
        first_two=False,
        in_group=False,
        truth_probability=0.0,
        no_gap=0.0,
        unexplained=0.0,
    )


def _scored(
    truth: TrueCase, diagnosis: Diagnosis, right: Wanted, group: frozenset[Key]
) -> CaseScore:
    """What can be said of an answer in either round; `group` is that of the truth."""
    claim = claimed(diagnosis)
    tension = diagnosis.tension_after_n
    return replace(
        _blank(truth),
        leader=claim.leader,
        leading_probability=claim.probability,
        right=right.effects in claim.keys if right.effects else claim.leader == right.rest,
        detected=claim.leader != NO_GAP,
        truth_probability=probability_of(diagnosis, right),
        no_gap=diagnosis.no_gap_probability,
        unexplained=diagnosis.unexplained_probability,
        tension_error_before=diagnosis.tension_before_n.mean / truth.tension_n - 1,
        tension_error_after=tension.mean / truth.tension_n - 1,
        tension_covered=tension.q025 <= truth.tension_n <= tension.q975,
        held_out_ratio=held_out_ratio(diagnosis.where, truth.frequencies),
        seconds=diagnosis.seconds,
        brier=brier(diagnosis, right),
        misattributed=bool(
            claim.causes and claim.probability > SURE and not claim.keys & group
        ),
        alike=tuple(each.effect for each in claim.causes if each.effect != claim.leader),
    )  # fmt: skip


def _with_causes(
    scored: CaseScore, truth: TrueCase, diagnosis: Diagnosis, effects: Key
) -> CaseScore:
    """Where what was planted stands among the causes."""
    ranked = by_probability(diagnosis)
    true = cause_of(diagnosis, effects)
    if true is None:
        return replace(scored, pair_told=_pair_told(diagnosis, scored, effects))
    alike = true.group is not None and true.group == ranked[0].group
    return replace(
        scored,
        first=true is ranked[0],
        first_two=true in ranked[:2],
        in_group=true is ranked[0] or alike,
        covered=_covered(true, truth),
        pair_told=_pair_told(diagnosis, scored, effects),
    )


def _pair_told(diagnosis: Diagnosis, scored: CaseScore, effects: Key) -> bool | None:
    """The pair or its group leads, or one of the two does and says that there is more.

    It does where the pair or something unexplained is among the first three of all answers.
    """
    if len(effects) != 2:
        return None
    answers: list[tuple[float, Key | str]] = [
        (diagnosis.no_gap_probability, NO_GAP),
        (diagnosis.unexplained_probability, UNEXPLAINED),
        *((cause.probability, key(cause.effects)) for cause in diagnosis.causes),
    ]
    first = [name for _, name in sorted(answers, key=lambda each: -each[0])[:_AMONG]]
    return scored.right or (scored.leader in effects and (UNEXPLAINED in first or effects in first))


def _covered(cause: Cause, truth: TrueCase) -> bool | None:
    """Whether the size of a single effect lies in its 90 % interval, where its place was found."""
    planted = truth.effects[0]
    if len(truth.effects) > 1 or cause.at != planted.at or not cause.parameters:
        return None
    size = cause.parameters[0]
    value = planted.values.get(size.name)
    return None if value is None else size.q05 <= value <= size.q95


_TO_NORMAL = 1.4826
"""From the median of absolute errors to their standard deviation, were they normal."""


def held_out_ratio(where: Sequence[Residual], truth: Sequence[TrueFrequency]) -> float:
    """Root mean square error of held-out predictions of the true frequencies, after over before.

    1 where no cause was claimed: nothing has shrunk. NaN where nothing was held out, and where the
    baseline predicts better than was measured (by the median error, which blunders leave alone).
    """
    true_hz = {(each.test, each.plane, each.order): each.frequency_hz for each in truth}
    held = [
        (residual, true_hz[place])
        for residual in where
        if (place := (residual.test, residual.plane, residual.order)) in true_hz
        and math.isfinite(residual.held_out_before_percent)
    ]
    if not held:
        return NAN
    measured = np.array([residual.measured_hz / hz for residual, hz in held])
    before = _error(measured, [residual.held_out_before_percent for residual, _ in held])
    after = _error(measured, [residual.held_out_after_percent for residual, _ in held])
    if _rms(before) <= _TO_NORMAL * float(np.median(np.abs(measured - 1))):
        return NAN
    both = np.isfinite(after)
    return _rms(after[both]) / _rms(before[both]) if both.any() else 1.0


def _error(measured: FloatArray, percent: Sequence[float]) -> FloatArray:
    """Of predictions, as fractions of the truth, from measured over truth and over predicted."""
    return np.asarray(measured / (1 + np.array(percent) / 100) - 1)


def _rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2)))


NO_GAP = "no gap"
UNEXPLAINED = "unexplained"
NOTHING = "nothing"

Key = tuple[str, ...]
"""The effects of a cause in alphabetical order."""


def key(effects: Sequence[str]) -> Key:
    return tuple(sorted(effects))


@dataclass(frozen=True)
class Wanted:
    """The right answer: these effects or, where there are none, `rest`."""

    effects: Key = ()
    rest: str = ""


@dataclass(frozen=True)
class Claim:
    """What leads: the likeliest cause with those alike, `no gap` or `unexplained`."""

    leader: str
    probability: float
    causes: tuple[Cause, ...] = ()

    @property
    def keys(self) -> frozenset[Key]:
        return frozenset(key(cause.effects) for cause in self.causes)


def wanted(truth: TrueCase) -> Wanted:
    """With the whole catalogue at hand."""
    if truth.kind == "none":
        return Wanted(rest=NO_GAP)
    if truth.kind == "unknown":
        return Wanted(rest=UNEXPLAINED)
    return Wanted(key([effect.name for effect in truth.effects]))


def wanted_without(truth: TrueCase) -> Wanted:
    """With what was planted taken out of the catalogue."""
    return Wanted(rest=NO_GAP if truth.kind == "none" else UNEXPLAINED)


def claimed(diagnosis: Diagnosis) -> Claim:
    leading = diagnosis.leading
    if leading is not None:
        return Claim(leading.effect, diagnosis.claim(leading), alike(diagnosis, leading))
    no_gap, unexplained = diagnosis.no_gap_probability, diagnosis.unexplained_probability
    if diagnosis.leads == "no gap":
        return Claim(NO_GAP, no_gap)
    return Claim(UNEXPLAINED, unexplained)


def alike(diagnosis: Diagnosis, cause: Cause) -> tuple[Cause, ...]:
    """The cause and the others of its group."""
    if cause.group is None:
        return (cause,)
    return tuple(each for each in diagnosis.causes if each.group == cause.group)


def cause_of(diagnosis: Diagnosis, effects: Key) -> Cause | None:
    """The cause that is these effects and no other; None where it was not tried."""
    return next((each for each in diagnosis.causes if key(each.effects) == effects), None)


def by_probability(diagnosis: Diagnosis) -> list[Cause]:
    return sorted(diagnosis.causes, key=lambda cause: -cause.probability)


def group_of_truth(diagnosis: Diagnosis | None, effects: Key) -> frozenset[Key]:
    """What these data cannot tell from what was planted, by this answer; of two also from each."""
    planted = {effects, *((effect,) for effect in effects)}
    found = set(planted)
    for each in planted:
        cause = cause_of(diagnosis, each) if diagnosis is not None else None
        if diagnosis is not None and cause is not None:
            found |= {key(other.effects) for other in alike(diagnosis, cause)}
    return frozenset(found)


def probability_of(diagnosis: Diagnosis, right: Wanted) -> float:
    """What the answer gives to what is right; 0 for a pair that it did not try."""
    if right.rest:
        no_gap = right.rest == NO_GAP
        return diagnosis.no_gap_probability if no_gap else diagnosis.unexplained_probability
    cause = cause_of(diagnosis, right.effects)
    return 0.0 if cause is None else cause.probability


def brier(diagnosis: Diagnosis, right: Wanted) -> float:
    """The sum of squares of probability less truth over all categories (Brier 1950), 0 to 2."""
    rest = (diagnosis.no_gap_probability, diagnosis.unexplained_probability)
    squares = sum(each * each for each in (*rest, *(c.probability for c in diagnosis.causes)))
    return squares - 2 * probability_of(diagnosis, right) + 1
