"""Every question put to the cases: all of them, by richness, by way, by effect."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from shm.blind.scoring.asked import BY_EFFECT, LARGE, QUESTIONS
from shm.blind.scoring.estimates import Estimate, difference
from shm.blind.scoring.questions import Bounds, Question
from shm.values import CaseScore, Mark, Richness, Score

FEWEST = 10
"""A mark from fewer cases is neither met nor missed."""
MOST_LOST = 0.05
"""What time histories and identification may cost."""
_ROUNDING = 1e-9


def marks(
    first_round: Sequence[CaseScore], left_out: Sequence[CaseScore], rng: np.random.Generator
) -> tuple[Mark, ...]:
    """All scores of a trial, those that are promised with their bounds.

    Without a second round its questions are not asked.
    """
    rounds = {"first": first_round, "left out": left_out}
    asked = [question for question in QUESTIONS if rounds[question.round]]
    return tuple(
        mark for question in asked for mark in _marks(question, rounds[question.round], rng)
    )


def _marks(question: Question, cases: Sequence[CaseScore], rng: np.random.Generator) -> list[Mark]:
    mine = question.of(cases)
    overall = _mark(question, _estimate(question, mine, rng).score, question.overall)
    by_richness = [_of_richness(question, mine, each, rng) for each in get_args(Richness)]
    by_way = _by_way(question, mine, rng) if question.better else []
    by_effect = _by_effect(question, mine, rng) if _is_by_effect(question) else []
    return [overall, *by_richness, *by_way, *by_effect]


def _estimate(question: Question, cases: Sequence[CaseScore], rng: np.random.Generator) -> Estimate:
    return question.estimate(question.samples(cases), rng)


def _mark(question: Question, score: Score, bounds: Bounds) -> Mark:
    mark = Mark(question.name, score, bounds.lower, bounds.upper, above=question.above)
    if not mark.asked or score.cases < FEWEST or not math.isfinite(score.value):
        return mark
    return replace(mark, met=bounds.lower - _ROUNDING <= score.value <= bounds.upper + _ROUNDING)


def _of_richness(
    question: Question, cases: Sequence[CaseScore], richness: Richness, rng: np.random.Generator
) -> Mark:
    own = [case for case in cases if case.richness == richness]
    bounds = question.each.get(richness, Bounds())
    return replace(_mark(question, _estimate(question, own, rng).score, bounds), richness=richness)


def _by_way(question: Question, cases: Sequence[CaseScore], rng: np.random.Generator) -> list[Mark]:
    """Both ways and what recordings cost; the bound is on what gets worse."""
    modes, recordings = (
        _estimate(question, [case for case in cases if case.way == way], rng)
        for way in ("modes", "recordings")
    )
    worst = Bounds(lower=-MOST_LOST) if question.better > 0 else Bounds(upper=MOST_LOST)
    lost = _mark(question, difference(recordings, modes), worst)
    return [
        replace(_mark(question, modes.score, Bounds()), way="modes"),
        replace(_mark(question, recordings.score, Bounds()), way="recordings"),
        replace(lost, way="recordings less modes"),
    ]


def _is_by_effect(question: Question) -> bool:
    return question.name in BY_EFFECT and question.above == LARGE


def _by_effect(
    question: Question, cases: Sequence[CaseScore], rng: np.random.Generator
) -> list[Mark]:
    found = []
    for effect in sorted({case.planted for case in cases}):
        own = [case for case in cases if case.planted == effect]
        score = _estimate(question, own, rng).score
        found.append(replace(_mark(question, score, Bounds()), effect=effect))
    return found
