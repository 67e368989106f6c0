"""A solved trial is opened with its key: both seals are verified, then it is scored."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shm.blind.answers import read_answers, verified_sha256
from shm.blind.layout import read_trial
from shm.blind.scoring.trial import trial_score
from shm.blind.sealing import key_of
from shm.values import TrialScore

_BOOTSTRAP_SEED = 0


def opened(directory: Path, key: Path) -> TrialScore:
    """The score of the trial in `directory`, the same each time; with the second round if there is.

    Raises BadInput where the key is another's, where key or answers were changed since they were
    sealed, and NothingThere where the trial is not solved.
    """
    trial = read_trial(directory)
    truths, seed = key_of(trial, key)
    sealed = verified_sha256(trial, "answers")
    second = trial.seal("left_out").exists()
    if second:
        verified_sha256(trial, "left_out")
    return trial_score(
        truths,
        read_answers(trial.answers("answers")),
        read_answers(trial.answers("left_out")) if second else (),
        (trial.key_sha256, sealed),
        seed,
        np.random.default_rng(_BOOTSTRAP_SEED),
    )
