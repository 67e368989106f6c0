"""The scores of a blind trial: which is which, in words, with intervals and bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from shm.report import formatting
from shm.values import CaseScore, Mark, MarkName, Richness, Score, TrialScore

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


@dataclass(frozen=True)
class Phrase:
    """What a score is in a few words, and in a sentence what it counts."""

    title: str
    explained: str


PHRASES: dict[MarkName, Phrase] = {
    "detected": Phrase("gaps seen", "share of planted causes at which anything but no gap leads"),
    "false alarms": Phrase(
        "false alarms", "share of hangers without any effect at which no gap does not lead"
    ),
    "named first": Phrase(
        "effect named first", "share of single effects that are the likeliest of all causes"
    ),
    "among the first two": Phrase(
        "effect among the first two", "share of single effects among the two likeliest causes"
    ),
    "in its group": Phrase(
        "effect first or in the first's group",
        "share of single effects that the likeliest cause is, or that it cannot be told from",
    ),
    "two effects told": Phrase(
        "two effects told",
        "the pair or its group leads; or one of the two does, with the pair or something "
        "unexplained among the first three answers",
    ),
    "right where sure": Phrase(
        "right where more than 0.9 sure", "share of the answers above 0.9 that are right"
    ),
    "unknown called unexplained": Phrase(
        "not in the catalogue: called unexplained", "share of causes that the catalogue lacks"
    ),
    "unknown misattributed": Phrase(
        "not in the catalogue: another effect blamed", "named with more than 0.9"
    ),
    "left out called unexplained": Phrase(
        "left out: called unexplained",
        "second round, the true effect taken out of the catalogue: unexplained leads",
    ),
    "left out misattributed": Phrase(
        "left out: another effect blamed",
        "second round: an effect named with more than 0.9, outside the true one's group",
    ),
    "calibration error": Phrase(
        "calibration error",
        "how far leading probabilities lie from the share that is right, less what few cases add",
    ),
    "calibration error as counted": Phrase(
        "calibration error as counted", "with the scatter that few cases add"
    ),
    "calibration error by chance": Phrase(
        "calibration error by chance alone", "what would be counted were every probability right"
    ),
    "calibration missed if perfect": Phrase(
        "calibration's mark missed by perfect forecasts",
        "share of trials that would miss it although every probability is right",
    ),
    "calibration error above size four": Phrase(
        "calibration error without small gaps",
        "of sound hangers and sizes above four, which a diagnosis cannot know to be so large",
    ),
    "log score": Phrase(
        "log score", "mean of -ln of the probability given to the truth; 0 is best"
    ),
    "Brier score": Phrase(
        "Brier score", "mean square error of all probabilities; 0 is best, 2 worst"
    ),
    "tension error of sound hangers, %": Phrase(
        "median error of the tension of sound hangers, %", "what bar and length leave unknown"
    ),
    "tension error before, %": Phrase(
        "median error of the tension before, %", "by the baseline alone"
    ),
    "tension error after, %": Phrase("median error of the tension after, %", "by the answer"),
    "tension error after over before": Phrase(
        "error of the tension, after over before", "ratio of the two medians"
    ),
    "tension covered": Phrase(
        "tension in its 95 % interval", "share of all cases, whatever was planted"
    ),
    "size covered": Phrase(
        "effect's size in its 90 % interval", "of single effects whose place was found"
    ),
    "held-out misfit after over before": Phrase(
        "held-out error, after over before",
        "median ratio of errors of frequencies that were held out of the fit, against the truth",
    ),
    "held-out misfit worse": Phrase(
        "held-out error worse than before", "share of cases in which the answer predicts worse"
    ),
    "failed": Phrase("answers that failed", "they count as wrong everywhere"),
}


_DIGITS = (2, 3, 4, 5)  # tried in turn, until two shares read differently


def title(name: MarkName) -> str:
    return PHRASES[name].title


def scope(mark: Mark) -> str:
    """`two planes, size above 4`; what a score is of."""
    cost = "recordings less modes"
    way = {cost: cost, "": ""}.get(mark.way, f"from {mark.way}")
    size = f"size above {mark.above:g}" if mark.above else ""
    told = [mark.richness, formatting.quantity(mark.effect), way, size]
    return ", ".join(filter(None, told)) or "all"


def value(score: Score, signed: bool = False) -> str:
    """Two decimals, three significant digits of what is larger than 10."""
    if not math.isfinite(score.value):
        return "not known"
    return _number(score.value, signed)


def found(mark: Mark) -> str:
    """The value with so many decimals that it is seen on which side of its bounds it lies."""
    number = mark.score.value
    for digits in _DIGITS:
        shown = round(number, digits)
        if all(
            np.sign(shown - each) == np.sign(number - each) for each in (mark.lower, mark.upper)
        ):
            return f"{number:{'+' if is_cost(mark) else ''}.{digits}f}"
    return value(mark.score, is_cost(mark))


def interval(score: Score, signed: bool = False) -> str:
    if not math.isfinite(score.low + score.high):
        return "not known"
    return f"{_number(score.low, signed)} to {_number(score.high, signed)}"


def _number(number: float, signed: bool) -> str:
    if abs(number) >= 10:
        return formatting.plain(number)
    return f"{number:{'+' if signed else ''}.2f}"


def is_cost(mark: Mark) -> bool:
    return mark.way == "recordings less modes"


def bounds(mark: Mark) -> str:
    """`at least 0.95`."""
    lower, upper = math.isfinite(mark.lower), math.isfinite(mark.upper)
    form = "+g" if is_cost(mark) else "g"
    if lower and upper:
        return f"{mark.lower:{form}} to {mark.upper:{form}}"
    if lower:
        return f"at least {mark.lower:{form}}"
    return f"at most {mark.upper:{form}}" if upper else ""


def outcome(mark: Mark) -> str:
    """`met`, `missed`, `too few`; nothing where nothing is asked."""
    if not mark.asked:
        return ""
    return {True: "met", False: "missed", None: "too few"}[mark.met]


def of_cases(score: Score) -> str:
    """`180 of 184`, of a share."""
    return f"{score.value * score.cases:.0f} of {score.cases}"


def count(score: Score) -> str:
    """`1 case`, `96 cases`."""
    return formatting.counted(score.cases, "case")
