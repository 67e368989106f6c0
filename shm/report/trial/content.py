"""What a page of a trial picks out of its score."""

from __future__ import annotations

from typing import Literal

from shm.values import CaseScore, Mark, MarkName, Richness, TrialScore

RICHNESS: tuple[Richness, ...] = (
    "one plane", "two planes", "known mass", "shapes", "conditions", "everything"
)  # fmt: skip


def find(
    score: TrialScore,
    name: MarkName,
    *,
    richness: Richness | Literal[""] = "",
    way: str = "",
    above: float | None = None,
) -> Mark | None:
    """The score of that name that is told first, of that richness and way; None where unasked."""
    return next(
        (
            mark
            for mark in score.marks
            if (mark.name, mark.richness, mark.way, mark.effect) == (name, richness, way, "")
            and above in (None, mark.above)
        ),
        None,
    )


def asked(score: TrialScore) -> tuple[Mark, ...]:
    """The marks with bounds to keep."""
    return tuple(mark for mark in score.marks if mark.asked)


def large(score: TrialScore) -> float:
    """The size above which the diagnosis is held to its marks."""
    mark = find(score, "detected")
    return mark.above if mark else 0.0


def judged(score: TrialScore, cases: tuple[CaseScore, ...]) -> list[CaseScore]:
    """Cases with sizes above that, and those without any effect."""
    least = large(score)
    return [case for case in cases if case.kind == "none" or case.size > least]


def missed(score: TrialScore) -> list[CaseScore]:
    """First-round answers, of sizes that are judged, that are wrong in all that they could be.

    Wrong is what leads, and the likeliest cause is neither the planted one nor alike.
    """
    return [
        case
        for case in judged(score, score.first_round)
        if not (case.right or case.in_group or case.pair_told)
    ]


def misled(score: TrialScore) -> list[CaseScore]:
    """Second-round answers that failed or blame an effect outside the group of the true one."""
    return [
        case
        for case in judged(score, score.left_out)
        if case.failure or case.misattributed
    ]  # fmt: skip
