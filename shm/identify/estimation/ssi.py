"""The default identifier: subspace identification of free decays, Hankel matrices summed over hits.

Each hit's ring-down gives one Hankel matrix of future responses times past references. Poles that
stay from order to order, and stay when any one hit is left out, are modes. Frequency and damping
are medians over a few high orders; standard deviations are the jackknife's. Ambient motion goes
the same way: the covariances of white-noise-driven modes are sums of free decays.

pyOMA2 cuts state-space models of rising order from the sum and solves them. Leaving out a hit need
not cost a decomposition of the whole: the Hankel matrix without it, times the leading right
singular vectors of the whole one, spans the same columns but for terms of second order.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from shm.identify.contract import LEAST_HITS, Dropped, Finding, FoundMode, Measurement, Poles
from shm.identify.estimation.close_pairs import split_close_pairs
from shm.identify.estimation.delays import delays_s, remove_delays
from shm.identify.estimation.hankel import STOPPED, Window, hankel, references, windows
from shm.identify.estimation.poles import PoleSet, diagram, find_again, resolved, stable_candidates
from shm.identify.estimation.pyoma import poles_of_orders
from shm.identify.estimation.shapes import modal_assurance
from shm.identify.estimation.validation import doubt, validate_candidates
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_AMBIENT_SD = 2.0
"""The chance in ambient motion moves a frequency more than noise does a ring-down's: so many times
the largest standard deviation of a hammer test are taken."""
# Rows are channels times lags and cost their cube; so many leave 0.9 s a test. Of modes 20 dB above
# the noise in 11 kinds of recordings_trial.py (seeds 0 to 2), ring-downs then give 79 %, with 240
# rows 72 %: modes of two planes that are all but equal need lags as long as their beat.
_ROWS = 640
_BLOCK_ROWS = (100, 220)
_MOST_ROWS = 880
_ROWS_FEW = 240
_BLOCK_ROWS_FEW = (60, 120)
"""Covariances of ambient motion are vague at long lags; fewer than three hits do not prove what a
larger model makes of noise."""
_BLOCK_ROWS_ALONE = 320
"""A single channel tells close modes apart by time alone: it needs more lags."""
_REFERENCES_AMBIENT = 8
"""Of what nobody hit, the channels' mixture by energy loses a low mode, whose accelerations are
small: the first of five of pyOMA2's example (4 references find four modes, 5 all). judgement: more
than eight channels are seldom of one set-up."""
_MAX_ORDER = 120  # judgement: two each of the 30 modes a plane that a long hanger has below 100 Hz
_FEW_ORDERS = 40
"""Where nobody hit, models that are far larger than what moves follow the chance in it: a structure
of five modes loses one in ten at orders up to 120, none at 28 to 40 (tests/worlds/recordings.py)"""
_LEAST_POINTS = 3
"""Of one hit, shapes alone tell a mode from noise in a window, and those of two channels agree by
chance: case1 of tests/identify/test_real_records.py, one channel, would have seven modes too many.
"""
_LONG = 0.75
"""Of the third longest: the shortest ring-down that windows look at. Lags are a third of the
shortest, and two planes' modes beat slowly: of five of 1.6 to 4.5 s in a record of a long hanger
(tests/worlds/recordings.py, plain 9302) a window finds 2 of 16 modes, of the three longest 10."""
_ROWS_WINDOW = 60  # judgement: two seconds of lags, at four times the reach of a window
_MOST_SUMS = 10  # judgement: parts of ambient motion by twos; Student's quantile is 6 % above
_COARSE_FROM = 60  # judgement: thirty orders or so tell what stays, and more only cost
_LEAST_ORDER = 2  # one mode
_RANK_TOLERANCE = 1e-17
"""Singular values below this share of the first are zero but for rounding."""
# judgement: as a pole is followed from order to order, see `candidates`; chance at three deviations
_SAME, _LIKE, _DEVIATIONS = 0.005, 0.8, 3.0
_FINAL_ORDERS = 5  # judgement: the median of five bears two strays; each costs a fit a hit


def summed_hankel_ssi(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Return modes of a measurement by multi-hit SSI (see the module's text)."""
    is_ambient = measurement.frequency_response is None and not measurement.hits
    most = {"most": _REFERENCES_AMBIENT} if is_ambient else {}
    mixed = references(measurement.decays, **most)
    rows = block_rows(measurement, options)
    matrices = [hankel(decay, mixed @ decay, rows) for decay in measurement.decays]
    if is_ambient:
        samples = sum(part.shape[1] for part in measurement.decays)
        options = replace(
            options,
            max_frequency_sd=_AMBIENT_SD * options.max_frequency_sd,
            ambient_s=samples / measurement.sampling_rate_hz,
        )
        matrices = _few_sums(matrices)
    found = modes_of_hankel(matrices, rows, measurement, options)
    if is_ambient:
        few = replace(options, max_order=min(options.max_order or _FEW_ORDERS, _FEW_ORDERS))
        found = merge_findings(found, modes_of_hankel(matrices, rows, measurement, few))
    checked = len(measurement.decays) > 1 or len(measurement.points) >= _LEAST_POINTS
    timed = bool(measurement.hits) or is_ambient
    if _repeated(measurement) or not (timed and checked):
        return found
    every = windows(measurement.sampling_rate_hz, options)
    return merge_findings(found, through_windows(measurement, options, every))


def search_windows(
    measurement: Measurement, options: IdentifyOptions, at_hz: Sequence[float]
) -> Finding | None:
    """Identify modes in windows around `at_hz`; None where windows were used or cannot be."""
    every = windows(measurement.sampling_rate_hz, options)
    around = [w for w in every if any(w.low_hz <= hz <= w.high_hz for hz in at_hz)]
    if not around or not measurement.hits or not _repeated(measurement):
        return None
    return through_windows(measurement, options, around)


def through_windows(
    measurement: Measurement, options: IdentifyOptions, every: Iterable[Window]
) -> Finding:
    """Return the modes that each window shows by itself."""
    return reduce(merge_findings, (_in_window(window, measurement, options) for window in every))


def _in_window(window: Window, measurement: Measurement, options: IdentifyOptions) -> Finding:
    rate, rate_slow = measurement.sampling_rate_hz, window.rate_hz(measurement.sampling_rate_hz)
    by_length = sorted(decay.shape[1] for decay in measurement.decays)
    least = _LONG * by_length[-min(LEAST_HITS, len(by_length))]
    long = [decay for decay in measurement.decays if decay.shape[1] >= least]
    decays = earlier = tuple(window.through(decay, rate) for decay in long)
    if options.ambient_s:
        earlier = tuple(window.through(motion, rate, forward=True) for motion in long)
    if max(map(np.std, decays)) < STOPPED * max(map(np.std, long)):
        return empty_finding(len(decays))
    mixed = references(decays)
    rows = min(_ROWS_WINDOW, min(decay.shape[1] for decay in decays) // 3)
    pairs = zip(decays, earlier, strict=True)
    matrices = [hankel(decay, mixed @ reference, rows) for decay, reference in pairs]
    slow = replace(measurement, decays=decays, sampling_rate_hz=rate_slow)
    return modes_of_hankel(
        _few_sums(matrices), rows, slow, window.options(options), window.shift_hz
    )


def _few_sums(matrices: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the matrices as no more than ten sums, each to be left out in turn."""
    return [np.sum(matrices[n::_MOST_SUMS], axis=0) for n in range(min(len(matrices), _MOST_SUMS))]


def _repeated(measurement: Measurement) -> bool:
    """Return whether there are hits enough to separate modes from noise."""
    hit = bool(measurement.hits) or measurement.frequency_response is not None
    return hit and len(measurement.decays) >= LEAST_HITS


def block_rows(measurement: Measurement, options: IdentifyOptions) -> int:
    """Return the number of time lags in the Hankel matrices."""
    shortest = min(decay.shape[1] for decay in measurement.decays)
    channels = len(measurement.points)
    rows, bounds = (_ROWS, _BLOCK_ROWS) if _repeated(measurement) else (_ROWS_FEW, _BLOCK_ROWS_FEW)
    shared = min(int(np.clip(rows // channels, *bounds)), _MOST_ROWS // channels)
    wanted = _BLOCK_ROWS_ALONE if channels == 1 else shared
    return int(min(options.block_rows or wanted, shortest // 3))


def modes_of_hankel(
    matrices: Sequence[FloatArray],
    rows: int,
    measurement: Measurement,
    options: IdentifyOptions,
    shift_hz: float = 0.0,
) -> Finding:
    """Return modes from the Hankel matrices of the hits, each of `rows` blocks of rows.

    `shift_hz` is what their frequencies lie below the true ones. With each hit left out in turn,
    the models are made in the columns that the leading right singular vectors combine.
    """
    total, rate_hz = np.sum(matrices, axis=0), measurement.sampling_rate_hz
    left, values, right = np.linalg.svd(total, full_matrices=False)
    max_order = _max_order(total.shape, values, rows, options.max_order or _MAX_ORDER)
    if max_order < _LEAST_ORDER:
        return empty_finding(len(matrices))
    orders = list(range(max_order, 0, -2 if max_order < _COARSE_FROM else -4))[::-1]
    leading = left[:, :max_order] * values[:max_order]
    sets = poles_of_orders(leading, rows, orders, rate_hz, shift_hz)
    projected = [matrix @ right[:max_order].T for matrix in matrices]
    whole, final = np.sum(projected, axis=0), final_orders(orders)
    without_each = [
        poles_of_orders(whole - each, rows, final, rate_hz, shift_hz)
        for each in (projected if len(projected) > 1 else ())
    ]
    seconds = max(decay.shape[1] for decay in measurement.decays) / rate_hz
    return stabilised(sets, without_each, seconds, options)


def _max_order(shape: tuple[int, int], values: FloatArray, rows: int, most: int) -> int:
    """Return the highest even order up to `most` that a matrix' size and numerical rank allow."""
    rank = int(np.sum(values > _RANK_TOLERANCE * values[0]))
    shifted_rows = shape[0] // rows * (rows - 1)
    largest = min(most, rank, shifted_rows // 2, shape[1])
    return int(largest // 2 * 2)


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
        candidates, unstable = stable_candidates(sets, orders, options, gaps=gaps)
    single, doubles = resolved(candidates, seconds)
    again = find_again(single, without_each_hit)
    final = [poles for poles in sets if poles.order in orders]
    separated, again = split_close_pairs(
        single, again, (final, without_each_hit), seconds,
        lambda candidate, repeat: not doubt(candidate, repeat, options),
    )  # fmt: skip
    modes, accepted, doubtful, refused = validate_candidates(separated, again, options)
    lost = sum(len(c.track) for c in candidates) - sum(len(c.track) for c in accepted)
    followed = Dropped("poles", lost, "stable, but of a mode that was dropped")
    dropped = (*unstable, followed, *doubles, *refused)
    return Finding(modes, dropped, diagram(sets, accepted, options), doubtful, late_s)


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
