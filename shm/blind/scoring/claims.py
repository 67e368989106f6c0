"""What an answer claims, and what it should have claimed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shm.values import Cause, Diagnosis, TrueCase

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
