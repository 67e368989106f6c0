"""Candidates found again with each hit left out, and what that proves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.identify import jackknife
from shm.identify.candidates import Candidate
from shm.identify.contract import Dropped, FoundMode
from shm.identify.jackknife import LEAST_HITS, jackknife_sd
from shm.identify.options import IdentifyOptions
from shm.identify.poles import PoleSet, real_shape
from shm.identify.tracks import Pole, continued
from shm.values import FloatArray

_FEW_HITS = 0.2
"""Where too few hits show whether a mode repeats, its poles must stay together this much closer."""
_SHARP = 0.1
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
    rows = [_in_one_model(candidates, sets) for sets in models]
    channels = [len(candidate.shape) for candidate in candidates]
    return [
        Repeats(
            np.array([row[index][0] for row in rows]),
            np.array([row[index][1] for row in rows]),
            np.array([row[index][2] for row in rows]).reshape(len(rows), channels[index]),
        )
        for index in range(len(candidates))
    ]


def _in_one_model(
    candidates: Sequence[Candidate], sets: Sequence[PoleSet]
) -> list[tuple[float, float, FloatArray]]:
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
    return [_repeat(*pair) for pair in zip(candidates, matches, strict=True)]


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
    shapes = [_aligned(real_shape(match.shape), candidate.shape) for _, match in matches]
    return (
        candidate.frequency_hz + float(frequency),
        candidate.damping_ratio + float(damping),
        np.asarray(np.median(shapes, axis=0)),
    )


def _aligned(shape: FloatArray, reference: FloatArray) -> FloatArray:
    return np.asarray(shape * (shape @ reference) / (shape @ shape))


def proven(
    candidates: Sequence[Candidate], repeats: Sequence[Repeats], options: IdentifyOptions
) -> tuple[tuple[FoundMode, ...], tuple[Dropped, ...]]:
    """The candidates that repeat, by rising frequency, and those dropped with the reason."""
    modes: list[FoundMode] = []
    dropped: list[Dropped] = []
    for candidate, repeat in sorted(
        zip(candidates, repeats, strict=True), key=lambda pair: pair[0].frequency_hz
    ):
        reason = _doubt(candidate, repeat, options)
        if reason:
            dropped.append(Dropped(f"mode at {candidate.frequency_hz:.4g} Hz", 1, reason))
        else:
            modes.append(_mode(candidate, repeat))
    return tuple(modes), tuple(dropped)


def _doubt(candidate: Candidate, repeat: Repeats, options: IdentifyOptions) -> str:
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
    frequency_sd = jackknife_sd(repeat.frequency_hz) / candidate.frequency_hz
    damping_sd = jackknife_sd(repeat.damping_ratio) / candidate.damping_ratio
    if frequency_sd > options.max_frequency_sd:
        return "its frequency changes from hit to hit"
    if damping_sd > options.max_damping_sd and frequency_sd > _SHARP * options.max_frequency_sd:
        return "its frequency and damping change from hit to hit"
    return ""


def _mode(candidate: Candidate, repeat: Repeats) -> FoundMode:
    return FoundMode(
        frequency_hz=candidate.frequency_hz,
        frequency_sd_hz=jackknife.frequency_sd(candidate.frequency_hz, repeat.frequency_hz),
        damping_ratio=candidate.damping_ratio,
        damping_sd=float(jackknife_sd(repeat.damping_ratio)),
        shape=candidate.shape,
        shape_sd=jackknife_sd(repeat.shape),
    )
