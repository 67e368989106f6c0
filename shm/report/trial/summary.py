"""A trial in words: what was tried on how much, what came out, which marks are met and missed."""

from __future__ import annotations

from collections import Counter

from shm.report import words
from shm.report.trial.content import asked, find
from shm.report.trial.phrases import (
    bounds,
    count,
    found,
    interval,
    is_cost,
    of_cases,
    outcome,
    scope,
    title,
    value,
)
from shm.values import Mark, MarkName, TrialScore


def verdict(score: TrialScore) -> str:
    """`41 of 45 marks met`."""
    told = Counter(outcome(mark) for mark in asked(score))
    judged = told["met"] + told["missed"]
    return f"{told['met']} of {words.counted(judged, 'mark')} met"


def summary(score: TrialScore) -> str:
    """For somebody who owns a bridge."""
    parts = (_tried(score), _named(score), _unknown(score), _tension(score), _marks(score))
    return " ".join(part for part in parts if part)


def _tried(score: TrialScore) -> str:
    kinds = Counter(case.kind for case in score.first_round)
    ways = Counter(case.way for case in score.first_round)
    told = [
        f"nothing in {kinds['none']}",
        f"one effect of the catalogue in {kinds['one']}",
        f"two in {kinds['two']}",
        f"something that the catalogue lacks in {kinds['unknown']}",
    ]
    recorded = f"; {ways['recordings']} came as recordings of hammer tests"
    return (
        f"{words.counted(score.cases, 'simulated hanger')} were put before the diagnosis, which "
        f"was not told what is wrong with them: {words.listed(told)}"
        f"{recorded if ways['recordings'] else ''}."
    )


def _named(score: TrialScore) -> str:
    seen, quiet, group = (
        _known(score, name) for name in ("detected", "false alarms", "in its group")
    )
    told = []
    if seen:
        told.append(
            f"it saw {of_cases(seen.score)} gaps larger than {seen.above:g} standard deviations"
        )
    if group:
        told.append(
            "had the planted effect first, or among those that it cannot tell from the first, in "
            f"{of_cases(group.score)}"
        )
    if quiet:
        told.append(f"gave false alarm at {of_cases(quiet.score)} sound hangers")
    listed = words.listed(told) if told else ""
    return f"{listed[:1].upper()}{listed[1:]}." if listed else ""


def _unknown(score: TrialScore) -> str:
    blamed, open_ = (
        _known(score, name) for name in ("left out misattributed", "left out called unexplained")
    )
    if not score.left_out:
        return "The second round, with the true effects left out of the catalogue, was not run."
    if not (blamed and open_):
        return ""
    return (
        "With the true effect taken out of its catalogue it said that none explains the gap in "
        f"{of_cases(open_.score)} and was sure of a wrong one in {of_cases(blamed.score)}."
    )


def _tension(score: TrialScore) -> str:
    before, after, inside = (
        _known(score, name)
        for name in ("tension error before, %", "tension error after, %", "tension covered")
    )
    if not (before and after and inside):
        return ""
    return (
        f"The tension was off by {value(before.score)} % before and {value(after.score)} % after "
        f"(medians), and its 95 % interval held the truth in {of_cases(inside.score)}."
    )


def _known(score: TrialScore, name: MarkName) -> Mark | None:
    """The score over all data, where a case speaks of it."""
    mark = find(score, name)
    return mark if mark and mark.score.cases else None


def _marks(score: TrialScore) -> str:
    told = Counter(outcome(mark) for mark in asked(score))
    sure = Counter(outcome(mark) for mark in asked(score) if mark.by_whole_interval)
    few = f"; of {told['too few']} too few cases speak" if told["too few"] else ""
    lost = told["missed"]
    missed = (
        f"{lost} {'is' if lost == 1 else 'are'} missed ({_surely(sure['missed'])}), listed below"
        if lost
        else "none missed"
    )
    return f"{verdict(score)} ({_surely(sure['met'])}), {missed}{few}."


def _surely(marks: int) -> str:
    """Of so many marks chance alone hardly did what they did."""
    return f"{marks or 'none'} with the whole interval"


def misses(score: TrialScore) -> list[str]:
    """Every mark that is missed, in a sentence."""
    return [sentence(mark) for mark in asked(score) if mark.met is False]


def sentence(mark: Mark) -> str:
    told = f"{found(mark)} ({interval(mark.score, is_cost(mark))})"
    what = f"{title(mark.name)} ({scope(mark)})"
    sure = ", missed with the whole interval" if mark.by_whole_interval else ""
    return f"{what[0].upper()}{what[1:]}: {told}, asked {bounds(mark)}{sure}; {count(mark.score)}."


def names_of(score: TrialScore) -> list[MarkName]:
    """The names of the scores in the order in which they are told."""
    return list(dict.fromkeys(mark.name for mark in score.marks))
