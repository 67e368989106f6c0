"""The report of a blind trial: its scores beside what was asked, every answer that was wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shm.report import words
from shm.report.paper import Fact, Paper, Part
from shm.report.trial.content import asked, find
from shm.report.trial.phrases import interval, value
from shm.report.trial.summary import misses, summary, verdict
from shm.report.trial.tables import answers, evidence
from shm.values import MarkName, TrialScore

if TYPE_CHECKING:
    from shm.report.figures.member import Illustration

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
            Part("Figures", figures=lambda: _figures(score)),
            Part("The scores", tables=answers(score)),
            Part("Every answer that was wrong", tables=evidence(score)),
        ),
        closing=f"{words.counted(score.cases, 'case')}, seed {score.seed}. SHA-256 of the key "
        f"{score.key_sha256}, of the answers {score.answers_sha256}. Intervals are 90 % bootstrap "
        "intervals over the cases; where all cases of a share agree, Jeffreys' interval.",
    )


def _figures(score: TrialScore) -> Sequence[Illustration]:
    from shm.report.trial.figures import trial_figures

    return trial_figures(score)


def facts(score: TrialScore) -> tuple[Fact, ...]:
    """The figures on top: what, value, what stands beside it."""
    found = [(name, find(score, mark)) for mark, name in _FACTS]
    return tuple(
        (name, value(mark.score), f"90 % interval {interval(mark.score)}")
        for name, mark in found
        if mark is not None and mark.score.cases
    )
