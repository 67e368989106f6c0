"""Decide which candidates are modes, and how sure they are, by hits left out and model orders."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.identify.contract import LEAST_HITS, Dropped, FoundMode
from shm.identify.estimation.poles import Candidate, Repeats
from shm.identify.estimation.shapes import aligned, modal_assurance, real_shape
from shm.identify.estimation.spread import frequency_sd, jackknife_sd, order_sd, smooth_sds
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

FEW_HITS = 0.2
"""Where too few hits show whether a mode repeats, its poles must stay together this much closer."""
_SHARP = 0.2
"""A frequency this much better than it must be is trusted even where the damping is not known."""
_LEAST_CHANNELS = 3
"""The shapes of two channels agree by chance."""
_LEAST_POINTS, _LEAST_POINTS_FEW = 1.5, 2.1
"""Points that take part in a shape, (sum of v^2)^2 / sum of v^4: one channel's noise has one. What
a biaxial sensor alone hears has two at most, or a few percent more with the noise of others: where
hits are few, its shape proves nothing."""
_SAME_SHAPE, _SURE_SHAPE = 0.95, 2.0
"""A mode that has the same shape whichever hit is left out may have twice the limit of the
frequency's standard deviation, to which Student's quantile for three hits adds 1.8, and any of
damping. In some 180 records with hits (tests/worlds/recordings.py, seeds 2000 to 2006), before
planes and orders are given, that finds 29 modes and 3 tracks of noise more."""
_MOST_TO_BE_ALONE = 3
"""Hits of which one alone may excite a plane. In the same records that finds 124 modes of two hits
and 1 track of noise, 16 and none of three, 7 and none of more, where it may be a disturbance."""
_STEADY_SHAPE = 0.998
"""What is as steady as that from order to order need not stay closer together where hits are few:
in the same records, 35 modes and 2 tracks of noise more; with 0.99, 53 and 15."""


def validate_candidates(
    candidates: Sequence[Candidate], repeats: Sequence[Repeats], options: IdentifyOptions
) -> tuple[tuple[FoundMode, ...], list[Candidate], tuple[FoundMode, ...], tuple[Dropped, ...]]:
    """Return the modes that repeat, by rising frequency, and their candidates; then the dropped.

    The dropped come as the modes that they may be, and with the reason.
    """
    accepted: list[Candidate] = []
    again: list[Repeats] = []
    doubtful: list[FoundMode] = []
    dropped: list[Dropped] = []
    for candidate, repeat in sorted(
        zip(candidates, repeats, strict=True), key=lambda pair: pair[0].frequency_hz
    ):
        reason = doubt(candidate, repeat, options)
        if reason:
            what = f"mode at {candidate.frequency_hz:.4g} Hz"
            dropped.append(Dropped(what, 1, reason, candidate.frequency_hz))
            by_hits_hz = frequency_sd(candidate.frequency_hz, repeat.frequency_hz)
            doubtful.append(_mode(candidate, repeat, by_hits_hz, options))
        else:
            accepted.append(candidate)
            again.append(repeat)
    modes = tuple(
        _mode(candidate, repeat, by_hits, options)
        for candidate, repeat, by_hits in zip(
            accepted, again, _by_hits(accepted, again), strict=True
        )
    )
    return modes, accepted, tuple(doubtful), tuple(dropped)


def _by_hits(candidates: Sequence[Candidate], repeats: Sequence[Repeats]) -> list[float]:
    """Return the standard deviation of each frequency in Hz from the scatter over hits."""
    frequency_hz = np.array([candidate.frequency_hz for candidate in candidates])
    sd_hz = np.array([
        frequency_sd(candidate.frequency_hz, repeat.frequency_hz)
        for candidate, repeat in zip(candidates, repeats, strict=True)
    ])  # fmt: skip
    hits = len(repeats[0].frequency_hz) if repeats else 0
    steady: list[float] = (smooth_sds(sd_hz / frequency_hz, hits) * frequency_hz).tolist()
    return steady


def doubt(candidate: Candidate, repeat: Repeats, options: IdentifyOptions) -> str:
    """Return the reason why a candidate is not trusted; empty where it is."""
    if candidate.collinearity < options.min_collinearity:
        return "its shape is not real (phase collinearity below the limit)"
    best = options.at_best(candidate.frequency_hz, candidate.damping_ratio)
    frequency_wide, damping_wide = (options.ambient_width * each for each in best)
    missed = int(np.sum(~np.isfinite(repeat.frequency_hz)))
    by_hits = len(repeat.frequency_hz) >= LEAST_HITS and not missed
    strict = 1.0 if by_hits or _steady(candidate) else FEW_HITS
    # What the order moves it by is part of its standard deviation.
    if candidate.frequency_spread > max(strict * options.max_frequency_spread, frequency_wide):
        return "its frequency changes with the model order"
    if candidate.damping_spread > max(strict * options.max_damping_spread, damping_wide):
        return "its damping changes with the model order"
    if missed and not _of_one_hit(candidate, repeat, options):
        return "not found again when one hit is left out"
    if not by_hits:
        return ""
    sure = _SURE_SHAPE if not options.ambient_s and _like(candidate, repeat.shape) else 1.0
    by_hits_hz = float(jackknife_sd(repeat.frequency_hz))
    sd = math.hypot(by_hits_hz, _within(candidate)) / candidate.frequency_hz
    damping_sd = jackknife_sd(repeat.damping_ratio) / candidate.damping_ratio
    if sd > max(sure * options.max_frequency_sd, frequency_wide):
        return "its frequency changes from hit to hit"
    sharp = sure > 1 or sd <= _SHARP * options.max_frequency_sd
    if damping_sd > max(options.max_damping_sd, damping_wide) and not sharp:
        return "its frequency and damping change from hit to hit"
    return ""


def _of_one_hit(candidate: Candidate, repeat: Repeats, options: IdentifyOptions) -> bool:
    """Return whether the mode is lost when one particular hit is left out, and only then.

    Accepted where a crew hits each plane once or twice: then it is trusted as a mode of a
    single hit is. With more hits it is a disturbance, and ambient motion moves every mode in
    each of its parts.
    """
    found = np.isfinite(repeat.frequency_hz)
    if options.ambient_s or len(found) > _MOST_TO_BE_ALONE or len(found) - np.sum(found) != 1:
        return False
    return len(found) < LEAST_HITS or _like(candidate, repeat.shape[found])


def _like(candidate: Candidate, shapes: FloatArray) -> bool:
    """Return whether the shape is that of one mode whichever hit is left out."""
    enough = _points(candidate) > _LEAST_POINTS
    return enough and _lowest_mac(candidate, shapes) > _SAME_SHAPE


def _steady(candidate: Candidate) -> bool:
    """Return whether the shape is that of one mode in the models of all orders."""
    shapes = np.array([real_shape(pole.shape) for pole in candidate.poles])
    enough = _points(candidate) > _LEAST_POINTS_FEW
    return enough and _lowest_mac(candidate, shapes) > _STEADY_SHAPE


def _points(candidate: Candidate) -> float:
    """Return the effective number of points in the shape; 0 where channels are too few to tell."""
    if len(candidate.shape) < _LEAST_CHANNELS:
        return 0.0
    squares = candidate.shape**2
    return float(np.sum(squares) ** 2 / np.sum(squares**2))


def _lowest_mac(candidate: Candidate, shapes: FloatArray) -> float:
    """Return the lowest modal assurance criterion with one of `shapes` (some, channels)."""
    return min(modal_assurance(candidate.shape, shape) for shape in shapes)


def _within(candidate: Candidate) -> float:
    """Return the standard deviation of the frequency in Hz that all hits have in common."""
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
