"""The figures of a blind trial. A new one: a file with a `FIGURE`, and a line in `MEMBERS`."""

from __future__ import annotations

from shm.report.figures.member import Illustration, Member, drawn
from shm.report.trial.figures.confusion import FIGURE as CONFUSION
from shm.report.trial.figures.coverage import FIGURE as COVERAGE
from shm.report.trial.figures.detection import FIGURE as DETECTION
from shm.report.trial.figures.held_out import FIGURE as HELD_OUT
from shm.report.trial.figures.left_out import FIGURE as LEFT_OUT
from shm.report.trial.figures.log_score import FIGURE as LOG_SCORE
from shm.report.trial.figures.reliability import FIGURE as RELIABILITY
from shm.report.trial.figures.tension import FIGURE as TENSION
from shm.values import TrialScore

MEMBERS: tuple[Member[TrialScore], ...] = (
    DETECTION,
    CONFUSION,
    RELIABILITY,
    LOG_SCORE,
    LEFT_OUT,
    TENSION,
    COVERAGE,
    HELD_OUT,
)


def trial_figures(score: TrialScore) -> tuple[Illustration, ...]:
    """Every figure of a trial that it has the numbers for, in reading order."""
    return drawn(MEMBERS, score)
