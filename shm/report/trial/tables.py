"""The tables of a trial, as headings and rows of texts."""

from __future__ import annotations

from collections.abc import Sequence

from shm.report import words
from shm.report.paper import Table, filled
from shm.report.trial.content import RICHNESS, asked, find, misled, missed
from shm.report.trial.phrases import (
    PHRASES,
    bounds,
    found,
    interval,
    is_cost,
    outcome,
    scope,
    title,
    value,
)
from shm.report.trial.summary import names_of
from shm.values import CaseScore, Mark, TrialScore

_ROWS_SHOWN = 20
"""Of the wrong answers in a terminal."""
_STYLES = {"met": "good", "missed": "refused", "too few": "unknown"}


def answers(score: TrialScore) -> tuple[Table, ...]:
    """The marks, then all scores by richness, effect and way, then those of no bound."""
    scores = (by_richness(score), by_effect(score), by_way(score), others(score))
    return filled(marks(score), *(table.without_terminal() for table in scores))


def evidence(score: TrialScore) -> tuple[Table, ...]:
    """Every case that went wrong."""
    return filled(
        _cases("Wrong answers of the first round", missed(score), _FIRST_NOTE),
        _cases("Wrong effects blamed with the true one left out", misled(score), _LEFT_OUT_NOTE),
    )


def marks(score: TrialScore) -> Table:
    own = asked(score)
    return Table(
        "Marks",
        ("mark", "outcome", "of", "asked", "found", "90 % interval", "cases"),
        tuple(_mark_row(mark) for mark in own),
        note="Met is what lies inside its bound as found, whatever the interval. A mark that fewer "
        "than ten cases speak of is neither met nor missed.",
        marks=tuple(_STYLES[outcome(mark)] for mark in own),
    )


def _mark_row(mark: Mark) -> tuple[str, ...]:
    return (
        title(mark.name),
        outcome(mark),
        scope(mark),
        bounds(mark),
        found(mark),
        interval(mark.score, is_cost(mark)),
        str(mark.score.cases),
    )


def by_richness(score: TrialScore) -> Table:
    """Every score that has a value at some richness."""
    rows = []
    for name in names_of(score):
        there = [find(score, name, richness=each) for each in RICHNESS]
        if overall := find(score, name):
            size = f", size above {overall.above:g}" if overall.above else ""
            rows.append((f"{title(name)}{size}", *map(_cell, there), _cell(overall)))
    return Table(
        "By richness of data",
        ("score", *RICHNESS, "all"),
        tuple(rows),
        note="In brackets the number of cases. "
        + " ".join(f"{each.title[0].upper()}{each.title[1:]}: {each.explained}."
                   for each in (PHRASES[name] for name in names_of(score))),
    )  # fmt: skip


def _cell(mark: Mark | None) -> str:
    if mark is None or not mark.score.cases:
        return ""
    return f"{value(mark.score)} ({mark.score.cases})"


def by_effect(score: TrialScore) -> Table:
    own = [mark for mark in score.marks if mark.effect]
    effects = sorted({mark.effect for mark in own})
    names = list(dict.fromkeys(mark.name for mark in own))
    named = {(mark.effect, mark.name): mark for mark in own}
    rows = []
    for effect in effects:
        scores = [named[effect, name].score for name in names]
        told = [f"{value(each)} ({interval(each)})" for each in scores]
        rows.append((words.quantity(effect), str(scores[0].cases), *told))
    return Table(
        f"By effect, {scope_of_sizes(own)}",
        ("planted", "cases", *(title(name) for name in names)),
        tuple(rows),
        note="One effect planted; in brackets 90 % intervals.",
    )


def scope_of_sizes(own: Sequence[Mark]) -> str:
    above = own[0].above if own else 0.0
    return f"size above {above:g}" if above else "any size"


def by_way(score: TrialScore) -> Table:
    """What the way through time histories and identification costs."""
    rows = []
    for name in names_of(score):
        ways = ("modes", "recordings", "recordings less modes")
        modes, recordings, cost = (find(score, name, way=way) for way in ways)
        if modes and recordings and cost:
            told = f"{value(cost.score, True)} ({interval(cost.score, True)})"
            rows.append((title(name), _cell(modes), _cell(recordings), told, outcome(cost)))
    return Table(
        "Modes as given, or identified from recordings",
        ("score", "modes", "recordings", "difference (90 % interval)", "outcome"),
        tuple(rows),
        note="No mark may get worse by more than 0.05 on the way through time histories.",
    )


def others(score: TrialScore) -> Table:
    """What nothing was promised of: smaller sizes, and more that is good to know."""
    own = [m for m in score.marks if not (m.asked or m.richness or m.way or m.effect)]
    return Table(
        "Other scores, of which nothing was promised",
        ("score", "of", "found", "90 % interval", "cases"),
        tuple(
            (title(m.name), scope(m), value(m.score), interval(m.score), str(m.score.cases))
            for m in own
            if m.score.cases
        ),
    )


_FIRST_NOTE = (
    "Cases above the size that is judged, and sound hangers, at which what leads is wrong and the "
    "likeliest cause is neither the planted one nor in its group."
)
_LEFT_OUT_NOTE = "An effect outside the group of the true one was named with more than 0.9."


def _cases(name: str, cases: Sequence[CaseScore], note: str) -> Table:
    return Table(
        name,
        ("case", "planted", "size", "data", "what was said", "probability", "of the truth"),
        tuple(_case_row(case) for case in cases),
        note=note,
    ).shortened(_ROWS_SHOWN)


def _case_row(case: CaseScore) -> tuple[str, ...]:
    return (
        case.case,
        words.quantity(case.planted),
        f"{case.size:.1f}",
        f"{case.richness}, {case.way}",
        _said(case),
        "" if case.failure else words.probability(case.leading_probability),
        "" if case.failure else words.probability(case.truth_probability),
    )


def _said(case: CaseScore) -> str:
    if case.failure:
        return f"failed: {case.failure}"
    alike = f" or {words.counted(len(case.alike), 'cause')} like it" if case.alike else ""
    return f"{words.quantity(case.leader)}{alike}"
