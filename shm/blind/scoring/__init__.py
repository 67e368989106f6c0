"""The answers of a blind trial beside the truth: case by case, then all scores and marks."""

from __future__ import annotations

from shm.blind.scoring.cases import case_scores, left_out_scores
from shm.blind.scoring.trial import opened, trial_score

__all__ = ["case_scores", "left_out_scores", "opened", "trial_score"]
