"""Candidates found again with each hit left out, and what that proves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.identify.contract import Dropped, FoundMode
from shm.identify.finding import jackknife
from shm.identify.finding.candidates import Candidate
from shm.identify.finding.jackknife import LEAST_HITS, jackknife_sd, order_sd
from shm.identify.finding.poles import PoleSet, aligned, median_shape, real_shape
from shm.identify.finding.tracks import Pole, continued
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_FEW_HITS = 0.2
"""Where too few hits show whether a mode repeats, its poles must stay together this much closer."""
_SHARP = 0.2
"""A frequency this much better than it must be is trusted even where the damping is not known."""


@dataclass(frozen=True, eq=False)
class Repeats:
    """One candidate found again with each hit left out in turn.

    `frequency_hz`, `damping_ratio` (hits,) and `shape` (hits, channels); NaN where not found.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shape: FloatArray


def find_again(
    candidates: Sequence[Candidate], models: Sequence[Sequence[PoleSet]]
) -> list[Repeats]:
    """The repeats of each candidate; `models` has one list of pole sets for each left-out hit."""
    matches = [_in_one_model(candidates, sets) for sets in models]
    return [
        repeats_of(candidate, [of_model[index] for of_model in matches])
        for index, candidate in enumerate(candidates)
    ]


def repeats_of(candidate: Candidate, matches: Sequence[Sequence[tuple[Pole, Pole]]]) -> Repeats:
    """The repeats from a list for each left-out hit: poles of the candidate, and these again."""
    rows = [_repeat(candidate, of_model) for of_model in matches]
    return Repeats(
        np.array([frequency for frequency, _, _ in rows]),
        np.array([damping for _, damping, _ in rows]),
        np.array([shape for _, _, shape in rows]).reshape(len(rows), len(candidate.shape)),
    )


def _in_one_model(
    candidates: Sequence[Candidate], sets: Sequence[PoleSet]
) -> list[list[tuple[Pole, Pole]]]:
    matches: list[list[tuple[Pole, Pole]]] = [[] for _ in candidates]
    for poles in sets:
        known = [
            (index, pole)
            for index, candidate in enumerate(candidates)
            for pole in candidate.poles
            if pole.order == poles.order
        ]
        again = continued([pole for _, pole in known], poles)
        for (index, pole), match in zip(known, again, strict=True):
            if match is not None:
                matches[index].append((pole, match))
    return matches


def _repeat(
    candidate: Candidate, matches: Sequence[tuple[Pole, Pole]]
) -> tuple[float, float, FloatArray]:
    """Frequency, damping and shape of a repeat: the candidate's own plus the median change."""
    if 2 * len(matches) < len(candidate.poles):
        return np.nan, np.nan, np.full(len(candidate.shape), np.nan)
    change = [
        (b.frequency_hz - a.frequency_hz, b.damping_ratio - a.damping_ratio) for a, b in matches
    ]
    frequency, damping = np.median(change, axis=0)
    shape = aligned(median_shape([match.shape for _, match in matches]), candidate.shape)
    return (
        candidate.frequency_hz + float(frequency),
        candidate.damping_ratio + float(damping),
        shape,
    )


def proven(
    candidates: Sequence[Candidate], repeats: Sequence[Repeats], options: IdentifyOptions
) -> tuple[tuple[FoundMode, ...], list[Candidate], tuple[Dropped, ...]]:
    """The candidates that repeat as modes, by rising frequency, and themselves; and those dropped
    with the reason."""
    kept: list[Candidate] = []
    again: list[Repeats] = []
    dropped: list[Dropped] = []
    for candidate, repeat in sorted(
        zip(candidates, repeats, strict=True), key=lambda pair: pair[0].frequency_hz
    ):
        reason = doubt(candidate, repeat, options)
        if reason:
            dropped.append(Dropped(f"mode at {candidate.frequency_hz:.4g} Hz", 1, reason))
        else:
            kept.append(candidate)
            again.append(repeat)
    modes = tuple(
        _mode(candidate, repeat, by_hits, options)
        for candidate, repeat, by_hits in zip(kept, again, _by_hits(kept, again), strict=True)
    )
    return modes, kept, tuple(dropped)


def _by_hits(candidates: Sequence[Candidate], repeats: Sequence[Repeats]) -> list[float]:
    """What the hits say of each frequency's standard deviation, in Hz."""
    frequency_hz = np.array([candidate.frequency_hz for candidate in candidates])
    sd_hz = np.array([
        jackknife.frequency_sd(candidate.frequency_hz, repeat.frequency_hz)
        for candidate, repeat in zip(candidates, repeats, strict=True)
    ])  # fmt: skip
    hits = len(repeats[0].frequency_hz) if repeats else 0
    steady: list[float] = (jackknife.steadied(sd_hz / frequency_hz, hits) * frequency_hz).tolist()
    return steady


def doubt(candidate: Candidate, repeat: Repeats, options: IdentifyOptions) -> str:
    """Why a candidate is not trusted; empty where it is."""
    if candidate.collinearity < options.min_collinearity:
        return "its shape is not real (phase collinearity below the limit)"
    strict = 1.0 if len(repeat.frequency_hz) >= LEAST_HITS else _FEW_HITS
    if candidate.frequency_spread > strict * options.max_frequency_spread:
        return "its frequency changes with the model order"
    if candidate.damping_spread > strict * options.max_damping_spread:
        return "its damping changes with the model order"
    if not np.all(np.isfinite(repeat.frequency_hz)):
        return "not found again when one hit is left out"
    by_hits = float(jackknife_sd(repeat.frequency_hz))
    frequency_sd = math.hypot(by_hits, _within(candidate)) / candidate.frequency_hz
    damping_sd = jackknife_sd(repeat.damping_ratio) / candidate.damping_ratio
    if frequency_sd > options.max_frequency_sd:
        return "its frequency changes from hit to hit"
    if damping_sd > options.max_damping_sd and frequency_sd > _SHARP * options.max_frequency_sd:
        return "its frequency and damping change from hit to hit"
    return ""


def _within(candidate: Candidate) -> float:
    """Standard deviation of the frequency that all hits together have, in Hz."""
    by_order = float(order_sd([pole.frequency_hz for pole in candidate.poles]))
    return math.hypot(by_order, candidate.blur_hz)


def _mode(
    candidate: Candidate, repeat: Repeats, by_hits: float, options: IdentifyOptions
) -> FoundMode:
    between_tests = options.frequency_allowance * candidate.frequency_hz
    dampings = order_sd([pole.damping_ratio for pole in candidate.poles])
    shapes = order_sd([aligned(real_shape(p.shape), candidate.shape) for p in candidate.poles])
    return FoundMode(
        frequency_hz=candidate.frequency_hz,
        frequency_sd_hz=math.hypot(by_hits, _within(candidate), between_tests),
        damping_ratio=candidate.damping_ratio,
        damping_sd=math.hypot(jackknife_sd(repeat.damping_ratio), dampings),
        shape=candidate.shape,
        shape_sd=np.hypot(jackknife_sd(repeat.shape), shapes),
    )
