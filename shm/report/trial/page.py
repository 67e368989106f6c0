"""A blind trial as one HTML file."""

from __future__ import annotations

from markupsafe import Markup

from shm.report import words
from shm.report.template import ENVIRONMENT
from shm.report.trial.content import asked, find
from shm.report.trial.figures import trial_figures
from shm.report.trial.phrases import interval, value
from shm.report.trial.summary import TITLE, misses, summary, verdict
from shm.report.trial.tables import answers, evidence
from shm.values import MarkName, TrialScore

_FACTS: tuple[tuple[MarkName, str], ...] = (
    ("detected", "Gaps seen"),
    ("false alarms", "False alarms"),
    ("in its group", "Effect or its group first"),
    ("left out misattributed", "Wrong effect blamed"),
    ("calibration error", "Calibration error"),
    ("tension covered", "Tension in its interval"),
)


def trial_page(score: TrialScore) -> str:
    """Everything about a trial: readable on screen (light or dark), on paper, by ear."""
    return ENVIRONMENT.get_template("trial.html.j2").render(
        title=TITLE,
        verdict=verdict(score),
        style="steady" if all(mark.met for mark in asked(score)) else _style(score),
        summary=summary(score),
        misses=misses(score),
        facts=_facts(score),
        illustrations=[
            (item, Markup(item.svg()))  # noqa: S704
            for item in trial_figures(score)
        ],
        answers=answers(score),
        evidence=evidence(score),
        score=score,
        cases=words.counted(score.cases, "case"),
    )


def _style(score: TrialScore) -> str:
    missed = any(mark.met is False for mark in asked(score))
    return "watch" if missed else "first"


def _facts(score: TrialScore) -> list[tuple[str, str, str]]:
    """The figures on top: what, value, what stands beside it."""
    found = [(name, find(score, mark)) for mark, name in _FACTS]
    return [
        (name, value(mark.score), f"90 % interval {interval(mark.score)}")
        for name, mark in found
        if mark is not None and mark.score.cases
    ]
