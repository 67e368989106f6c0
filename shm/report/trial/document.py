"""The score of a blind trial as a JSON document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from shm.report.trial.phrases import outcome, title
from shm.report.trial.summary import misses, summary, verdict
from shm.values import TrialScore

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
