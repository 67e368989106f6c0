"""The report of a blind trial: its scores beside what was asked, every answer that was wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from shm.report import formatting
from shm.report.figures.every_figure import trial_figures
from shm.report.paper import Fact, Paper, Part, Table, filled
from shm.report.trial_scores import (
    PHRASES,
    RICHNESS,
    asked,
    bounds,
    count,
    find,
    found,
    interval,
    is_cost,
    misled,
    missed,
    of_cases,
    outcome,
    scope,
    title,
    value,
)
from shm.values import CaseScore, Mark, MarkName, TrialScore

_FACTS: tuple[tuple[MarkName, str], ...] = (
    ("detected", "Gaps seen"),
    ("false alarms", "False alarms"),
    ("in its group", "Effect or its group first"),
    ("left out misattributed", "Wrong effect blamed"),
    ("calibration error", "Calibration error"),
    ("tension covered", "Tension in its interval"),
)


def trial_paper(score: TrialScore) -> Paper:
    """Summary with what is missed, figures, the scores, every wrong answer."""
    marks = asked(score)
    met, missed = all(mark.met for mark in marks), any(mark.met is False for mark in marks)
    return Paper(
        title="The gap diagnosis tried blind",
        status=verdict(score),
        style="steady" if met else "watch" if missed else "first",
        parts=(
            Part(
                "In short",
                summary=summary(score),
                facts=facts(score),
                remarks=misses(score),
                remarks_title="Marks that are missed",
            ),
            Part("Figures", figures=lambda: trial_figures(score)),
            Part("The scores", tables=answers(score)),
            Part("Every answer that was wrong", tables=evidence(score)),
        ),
        closing=f"{formatting.counted(score.cases, 'case')}, seed {score.seed}. SHA-256 of the key "
        f"{score.key_sha256}, of the answers {score.answers_sha256}. Intervals are 90 % bootstrap "
        "intervals over the cases; where all cases of a share agree, Jeffreys' interval.",
    )


def facts(score: TrialScore) -> tuple[Fact, ...]:
    """The figures on top: what, value, what stands beside it."""
    found = [(name, find(score, mark)) for mark, name in _FACTS]
    return tuple(
        (name, value(mark.score), f"90 % interval {interval(mark.score)}")
        for name, mark in found
        if mark is not None and mark.score.cases
    )


def verdict(score: TrialScore) -> str:
    """`41 of 45 marks met`."""
    told = Counter(outcome(mark) for mark in asked(score))
    judged = told["met"] + told["missed"]
    return f"{told['met']} of {formatting.counted(judged, 'mark')} met"


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
        f"{formatting.counted(score.cases, 'simulated hanger')} were put before the diagnosis, "
        f"which was not told what is wrong with them: {formatting.listed(told)}"
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
    listed = formatting.listed(told) if told else ""
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


_ROWS_SHOWN = 20
"""Of the wrong answers in a terminal."""
_STYLES = {"met": "good", "missed": "refused", "too few": "unknown"}


def answers(score: TrialScore) -> tuple[Table, ...]:
    """The marks, then all scores by richness, effect and way, then those of no bound."""
    scores = (by_richness(score), by_effect(score), by_way(score), others(score))
    return filled(marks(score), *(table.not_in_terminal() for table in scores))


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
        rows.append((formatting.quantity(effect), str(scores[0].cases), *told))
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
        formatting.quantity(case.planted),
        f"{case.size:.1f}",
        f"{case.richness}, {case.way}",
        _said(case),
        "" if case.failure else formatting.probability(case.leading_probability),
        "" if case.failure else formatting.probability(case.truth_probability),
    )


def _said(case: CaseScore) -> str:
    if case.failure:
        return f"failed: {case.failure}"
    alike = f" or {formatting.counted(len(case.alike), 'cause')} like it" if case.alike else ""
    return f"{formatting.quantity(case.leader)}{alike}"


SCORE_SCHEMA = "shm.blind_score/1"


def trial_json(score: TrialScore) -> dict[str, Any]:
    """A document for `shm.documents.dump`; unknown numbers and absent bounds become null there."""
    document = asdict(score)
    marks = [
        {
            **asdict(mark),
            "title": title(mark.name),
            "outcome": outcome(mark),
            "by_whole_interval": mark.by_whole_interval,
        }
        for mark in score.marks
    ]
    return {
        "schema": SCORE_SCHEMA,
        "verdict": verdict(score),
        "summary": summary(score),
        "missed": misses(score),
        **document,
        "marks": marks,
    }
