"""Separate modes from other poles for every identifier, and estimate channel delays.

One converter that goes from channel to channel samples the last up to a sample later than the
first, a second board may start late. A mode's phase at a channel that is late by tau falls behind
by 2 pi f tau: at 80 Hz and a sample of 256 Hz by a third of a turn, so that its shape is no longer
real. Delays that make the shapes of all modes real at once are taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import Dropped, Finding, FoundMode, Poles
from shm.identify.estimation.close_pairs import split_close_pairs
from shm.identify.estimation.poles import (
    Candidate,
    PoleSet,
    collinearity,
    diagram,
    modal_assurance,
    resolved,
    stable_candidates,
)
from shm.identify.estimation.repeats import FEW_HITS, LEAST_HITS, find_again, validate_candidates
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray, FloatArray

# judgement: as a pole is followed from order to order, see `candidates`; chance at three deviations
_SAME, _LIKE, _DEVIATIONS = 0.005, 0.8, 3.0
_FINAL_ORDERS = 5  # judgement: the median of five bears two strays; each costs a fit a hit


def final_orders(orders: Sequence[int]) -> list[int]:
    """Return the orders that estimates are taken from: up to five, spread over the upper half."""
    upper = [order for order in orders if 2 * order >= max(orders)]
    picks = np.linspace(0, len(upper) - 1, _FINAL_ORDERS).round().astype(int)
    return [upper[pick] for pick in sorted(set(picks.tolist()))]


def stabilised(
    sets: Sequence[PoleSet],
    without_each_hit: Sequence[Sequence[PoleSet]],
    seconds: float,
    options: IdentifyOptions,
) -> Finding:
    """Return the modes among the poles of models of rising order, `sets`.

    `without_each_hit` holds the poles at the final orders with each hit left out in turn; empty
    where there is one hit. `seconds` of ring-down decide what can be told apart.

    Every pole is in a mode's track or counted with the reason why not.
    """
    orders = final_orders([poles.order for poles in sets])
    # Where hits cannot prove a mode, the orders must: noise seldom makes a pole at nearly all.
    gaps = len(without_each_hit) >= LEAST_HITS
    candidates, unstable = stable_candidates(sets, orders, options, gaps=gaps)
    late_s = delays_s(candidates, options)
    if late_s is not None:
        sets = [remove_delays(poles, late_s) for poles in sets]
        without_each_hit = [[remove_delays(p, late_s) for p in of] for of in without_each_hit]
        candidates = [remove_candidate_delays(candidate, late_s) for candidate in candidates]
    single, doubles = resolved(candidates, seconds)
    final = [poles for poles in sets if poles.order in orders]
    again = find_again(single, without_each_hit)
    separated, again = split_close_pairs(single, again, (final, without_each_hit), seconds, options)
    modes, accepted, doubtful, refused = validate_candidates(separated, again, options)
    lost = sum(len(c.track) for c in candidates) - sum(len(c.track) for c in accepted)
    followed = Dropped("poles", lost, "stable, but of a mode that was dropped")
    dropped = (*unstable, followed, *doubles, *refused)
    return Finding(modes, dropped, diagram(sets, accepted, options), doubtful)


def merge_findings(found: Finding, other: Finding) -> Finding:
    """Return `found` with the modes of `other` that it lacks; dropped are those of both."""
    added = [mode for mode in other.modes if not any(_same(mode, each) for each in found.modes)]
    modes = tuple(sorted((*found.modes, *added), key=lambda mode: mode.frequency_hz))
    dropped = tuple(
        entry for entry in found.dropped if not any(_of(entry, mode.frequency_hz) for mode in added)
    )
    doubtful = (*found.doubtful, *other.doubtful)
    return replace(found, modes=modes, dropped=dropped, doubtful=doubtful)


def _same(one: FoundMode, other: FoundMode) -> bool:
    """Return whether the two may be one mode."""
    sd_hz = np.hypot(one.frequency_sd_hz, other.frequency_sd_hz)
    reach_hz = max(_SAME * one.frequency_hz, _DEVIATIONS * float(np.nan_to_num(sd_hz)))
    near = abs(one.frequency_hz - other.frequency_hz) < reach_hz
    return near and modal_assurance(one.shape, other.shape) > _LIKE


def _of(entry: Dropped, frequency_hz: float) -> bool:
    """Return whether the dropped pole is at that frequency."""
    return abs(entry.frequency_hz - frequency_hz) < _SAME * frequency_hz


def empty_finding(hits: int) -> Finding:
    """Return the finding where no sensor moves after any of `hits`."""
    nothing = np.empty(0)
    dropped = (Dropped("ring-downs", hits, "nothing moves in them"),)
    return Finding((), dropped, Poles(nothing, nothing, nothing, nothing.astype(bool)))


_LEAST_MODES = 6
"""Three of them foretell three others; of two, two channels' phases agree by chance."""
_REAL = 0.9
"""Phase collinearity of most modes, once delays are off that the others gave: of random phases at
three channels it is a half."""
_STEPS, _FINER, _PASSES = 33, 3, 6  # technical: delays to 1e-4 of a period, one channel at a time


def delays_s(candidates: Sequence[Candidate], options: IdentifyOptions) -> FloatArray | None:
    """Return the delay of each channel (channels,), up to half a period of the band's end.

    None where not validated: the delays of every other mode must make the shapes of the rest
    real, and more so than none do. Candidates that orders validate count, as where hits are
    few.
    """
    highest_hz = options.band_high_hz
    candidates = [
        each
        for each in candidates
        if each.frequency_spread < FEW_HITS * options.max_frequency_spread
        and each.damping_spread < FEW_HITS * options.max_damping_spread
    ]
    if len(candidates) < _LEAST_MODES or len(candidates[0].poles[-1].shape) < 2:
        return None
    frequency_hz = np.array([each.poles[-1].frequency_hz for each in candidates])
    shapes = np.array([each.poles[-1].shape for each in candidates])
    foretold = np.empty(len(shapes))
    for half in (slice(0, None, 2), slice(1, None, 2)):
        rest = np.ones(len(shapes), dtype=bool)
        rest[half] = False
        late_s = _most_real(frequency_hz[half], shapes[half], highest_hz)
        foretold[rest] = _realness(frequency_hz[rest], shapes[rest], late_s)
    as_given = _realness(frequency_hz, shapes, np.zeros(shapes.shape[1]))
    if np.median(foretold) < _REAL or foretold.mean() <= as_given.mean():
        return None
    return _most_real(frequency_hz, shapes, highest_hz)


def _realness(frequency_hz: FloatArray, shapes: ComplexArray, late_s: FloatArray) -> FloatArray:
    """Return the phase collinearity (modes,) of `shapes` (modes, channels) with delays removed."""
    return collinearity(shapes * np.exp(2j * np.pi * np.outer(frequency_hz, late_s)))


def _most_real(frequency_hz: FloatArray, shapes: ComplexArray, highest_hz: float) -> FloatArray:
    """Return the delays with the largest sum over the modes of |sum of v^2|, the first 0."""
    squares = shapes**2 / np.sum(np.abs(shapes) ** 2, axis=1, keepdims=True)
    late_s = np.zeros(shapes.shape[1])
    reach_s = 1 / (2 * highest_hz)
    for finer in range(_FINER):
        steps_s = np.linspace(-1, 1, _STEPS) * reach_s / (_STEPS // 4) ** finer
        for _ in range(_PASSES):
            for channel in range(1, len(late_s)):
                turned = squares * np.exp(4j * np.pi * np.outer(frequency_hz, late_s))
                others = turned.sum(axis=1) - turned[:, channel]
                tried_s = steps_s + (late_s[channel] if finer else 0.0)
                orders = squares[:, channel] * np.exp(4j * np.pi * np.outer(tried_s, frequency_hz))
                late_s[channel] = tried_s[np.argmax(np.abs(others + orders).sum(axis=1))]
    return late_s


def remove_delays(poles: PoleSet, late_s: FloatArray) -> PoleSet:
    """Return the poles with the shapes that channels without delays have."""
    turns = np.exp(2j * np.pi * np.outer(late_s, poles.frequency_hz))
    return replace(poles, shapes=poles.shapes * turns)


def remove_candidate_delays(candidate: Candidate, late_s: FloatArray) -> Candidate:
    """Return the candidate with the shapes that channels without delays have."""
    track = tuple(
        replace(pole, shape=pole.shape * np.exp(2j * np.pi * pole.frequency_hz * late_s))
        for pole in candidate.track
    )
    orders = {pole.order for pole in candidate.poles}
    return replace(candidate, track=track, poles=tuple(p for p in track if p.order in orders))
