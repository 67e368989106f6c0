"""The answers of a blind trial beside the truth: case by case, then all scores and marks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from shm.blind.layout import read_answers, read_trial, verified_sha256
from shm.blind.scoring.cases import case_scores, left_out_scores
from shm.blind.scoring.marks import marks
from shm.blind.scoring.scores import figures, leading, reliability, share
from shm.blind.sealing import key_of
from shm.values import Answer, Bin, CaseScore, Richness, TrialScore, TrueCase

__all__ = ["case_scores", "left_out_scores", "opened", "trial_score"]


# Factors of 2 where detection rises, of 4 where it is sure: technical, bins of a figure.
_SIZES = (0.0, 2.0, 4.0, 8.0, 32.0, 128.0, np.inf)


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
        np.random.default_rng(0),
    )


def trial_score(
    truths: Sequence[TrueCase],
    first_round: Sequence[Answer],
    left_out: Sequence[Answer],
    hashes: tuple[str, str],
    seed: int,
    rng: np.random.Generator,
) -> TrialScore:
    """Both rounds scored; `left_out` is empty where there was no second one.

    `hashes` are the SHA-256 of the key and of the first round's answers, `seed` that of the trial;
    `rng` draws the bootstrap. Raises BadInput for answers to cases that the key does not hold.
    """
    first = case_scores(truths, first_round)
    second = left_out_scores(truths, first_round, left_out) if left_out else ()
    return TrialScore(
        cases=len(truths),
        seed=seed,
        key_sha256=hashes[0],
        answers_sha256=hashes[1],
        marks=marks(first, second, rng),
        first_round=first,
        left_out=second,
        detection=_detection(first, rng),
        reliability=reliability(figures(leading, lambda case: case.right)(first), rng),
    )


def _detection(cases: Sequence[CaseScore], rng: np.random.Generator) -> tuple[Bin, ...]:
    """The share detected by size, over all cases and by richness."""
    planted = [case for case in cases if case.kind != "none"]
    found = [*_by_size(planted, "", rng)]
    for richness in get_args(Richness):
        own = [case for case in planted if case.richness == richness]
        found += _by_size(own, richness, rng)
    return tuple(found)


def _by_size(
    cases: Sequence[CaseScore], richness: Richness | Literal[""], rng: np.random.Generator
) -> list[Bin]:
    found = []
    for low, high in pairwise(_SIZES):
        own = [case for case in cases if low <= case.size < high]
        if own:
            sizes = np.array([case.size for case in own])
            score = share(figures(lambda case: case.detected)(own), rng).score
            mean = float(np.exp(np.log(sizes).mean()))
            found.append(Bin(low, high, mean, score, richness))
    return found
