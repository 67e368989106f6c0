"""Find the faults of each acceleration after each hit: of loggers, cables and what else struck."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shm.identify.measuring.band import RATE_OVER_BAND, thinned
from shm.identify.measuring.hits import RINGING_SAMPLES, HitRecord
from shm.identify.measuring.prediction import knocked_at, surprise
from shm.identify.options import IdentifyOptions
from shm.values import PLANES, BoolArray, Channel, FloatArray, Plane

DOUBLE_HIT = "double hit"
CUT_OFF = "ring-down cut off"
NOT_A_NUMBER = "not-a-number samples"
FROZEN = "drop-out: the signal stands still"
CLIPPED = "clipped acceleration"
CABLE = "cable fault or a clock that drifts: jumps or bursts in one channel"
WANDERS = "cable fault: the offset wanders more than the hanger moves"
COPY = "cable fault: a copy of another channel"
DEAD = "its value never changes: dead sensor or cable"
SILENT = "cable fault: less than a thousandth of the other channels of its plane"
HITS_NOT_SHOWN = "cable fault: without the hits that the motion shows"
KNOCK = "disturbed: something other than the hammer struck, or samples are lost"
OUTLIER = "outlier: its response is unlike that of the other hits"
FEWEST_TO_COMPARE = 3
"""Of two that differ nobody can say which is right."""
# identify_limits.py (docs/trials/identification_benchmarks.md): sound hits lie below 0.013, planted
# outliers above 0.23 and 136 times the median
MOST_UNLIKE = 0.05
"""Midway: how unlike hits are to each other, 0 alike, 1 unlike."""

Faults = NDArray[np.object_]
"""Of each channel after each hit, (hits, channels); an empty text where none."""
_SURPRISE = 5.0
"""Of 7,114 ring-downs of 110 sound simulated tests, 20 to 60 dB above noise, none was above 3.1; of
92 with a cable fault in 23 tests, none below 9."""
# identify_limits.py (docs/trials/identification_benchmarks.md): in sound tests the offset moves by
# 0.07 of the ringing at most, a channel by 0.59 of the median one at least; the rest is judgement
_OFFSET_SECONDS = 0.5
_OFFSET_MOVES = 2.0
_MOST_DEGREES = 30  # technical: beyond half a minute a hanger has rung down
_SILENT_SHARE = 1e-3
_COPY_SAMPLES = 256  # noise in the last bit alone makes as many alike once in 2^256
_MOST_CLIPPED = 0.5  # judgement: with less than half of it left, a ring-down says little
LEAST_REPEATS = 3  # judgement: a crest may hold two equal samples
FULL_SCALE_SHARE = 0.999
"""A converter's largest code lies below its full scale: by 1/2048 of it for 12 bits."""
FROZEN_SAMPLES = 16  # judgement: 8 ms at 2 kHz; shorter gaps are `surprise`'s
# Crests have 3 to 4 times as many at the top (`_is_crowded`), clipped tests 40 and more: as above
_LEVELS_BELOW = 10
_TOP = 200
_CROWDED = 8.0
_MOVES = 30.0  # judgement: three times the nine levels about a crest, see `_stands_still`
_FINE = 4000.0
"""Levels up to the peak: forces of hits differ by tens of percent, a thousand levels, so that two
are hardly the same by chance."""


def faults_of_channels(
    channels: Sequence[Channel],
    ring_downs: Sequence[HitRecord],
    sampling_rate_hz: float,
    options: IdentifyOptions,
) -> Faults:
    """Return the fault of each channel after each hit, (hits, channels); empty where none.

    The first that is found takes precedence, and what has one is not asked for the next.
    """
    faults = np.full((len(ring_downs), len(channels)), "", dtype=object)
    if not ring_downs:
        return faults
    cuts = [r.accelerations[:, r.clipped_end or r.pulse.start : r.pulse.stop] for r in ring_downs]
    rings = [r.accelerations[:, r.free : r.pulse.stop] for r in ring_downs]
    free, step = _thin(ring_downs, sampling_rate_hz, options)

    def add(fault: str, found: BoolArray) -> None:
        faults[found & (faults == "")] = fault

    for fault, is_found in _PLAIN_FAULTS.items():
        add(fault, np.array([is_found(cut) for cut in cuts]))
    planes = [channel.plane for channel in channels]
    add(SILENT, np.array([_silent(cut, planes) for cut in cuts]))
    add(CLIPPED, _clipped(channels, rings, faults == ""))
    add(WANDERS, np.array([_wanders(part, sampling_rate_hz / step) for part in free]))
    knocks, wild = _surprises(free, faults == "", planes)
    add(KNOCK, wild & knocks[:, np.newaxis])
    add(CABLE, wild)
    return faults


def _thin(
    ring_downs: Sequence[HitRecord], sampling_rate_hz: float, options: IdentifyOptions
) -> tuple[list[FloatArray], int]:
    """Return the free motion after each hit, thinned, and every how many samples that is."""
    wanted_hz = RATE_OVER_BAND * options.band_high_hz
    rings = [
        r.accelerations[:, r.free + RINGING_SAMPLES : r.pulse.stop - RINGING_SAMPLES]
        for r in ring_downs
    ]
    thin = [thinned(ring, sampling_rate_hz, wanted_hz) for ring in rings]
    return thin, max(1, int(sampling_rate_hz / wanted_hz))


def until_disturbed(
    channels: Sequence[Channel],
    ring_downs: Sequence[HitRecord],
    faults: Faults,
    least_samples: float,
    sampling_rate_hz: float,
    options: IdentifyOptions,
) -> tuple[list[HitRecord], Faults]:
    """Cut ring-downs at an impact or a drop-out of one channel, and return them and their faults.

    They are cut only if that leaves `least_samples`; a channel that mostly drops out is no
    reason.
    """
    free, step = _thin(ring_downs, sampling_rate_hz, options)
    cut_down = list(ring_downs)
    drops_out = np.isin(faults, (NOT_A_NUMBER, FROZEN))
    drops_out &= 2 * np.sum(faults != "", axis=0) <= len(faults)  # it has no fault after most hits
    for number, r in enumerate(ring_downs):
        heard, gaps = faults[number] == KNOCK, np.flatnonzero(drops_out[number])
        if any(heard):
            at = knocked_at([part[heard] for part in free], number, _SURPRISE)
            cut, stop = KNOCK, r.free + RINGING_SAMPLES + at * step
        elif len(gaps):
            rings = r.accelerations[gaps, r.free : r.pulse.stop]
            cut = faults[number, gaps[0]]
            stop = r.free + min(map(_gap_in, rings)) - RINGING_SAMPLES
        else:
            continue
        if stop - r.free >= least_samples:
            cut_down[number] = replace(r, pulse=replace(r.pulse, stop=stop), cut=cut)
    if not any(r.cut for r in cut_down):
        return cut_down, faults
    return cut_down, faults_of_channels(channels, cut_down, sampling_rate_hz, options)


def _gap_in(signal: FloatArray) -> int:
    """Return the sample from which a signal is missing or frozen; 0 where neither is."""
    if not np.all(np.isfinite(signal)):
        return int(np.argmin(np.isfinite(signal)))
    return next((first for first, _ in _still_runs(signal)), 0)


def _silent(cut: FloatArray, planes: Sequence[Plane | None]) -> BoolArray:
    """Return the channels that hardly move while others of their plane do; all may lie across."""
    moves, found = np.ptp(cut, axis=1), np.zeros(len(cut), dtype=bool)
    for plane in set(planes):
        group = np.array([each == plane for each in planes])
        sound = group & (moves > 0)
        found[group] = moves[group] < _SILENT_SHARE * (np.median(moves[sound]) if any(sound) else 0)
    return found


def _is_copy(cut: FloatArray) -> BoolArray:
    """Return the channels with the samples of another; the first of two stays without fault."""
    begins = [row[:_COPY_SAMPLES].tobytes() for row in cut]
    return np.array([begin in begins[:row] for row, begin in enumerate(begins)])


def frozen(signals: FloatArray) -> BoolArray:
    """Return which signals, (channels, samples), are constant for 16 samples while others move."""
    return np.array([bool(_still_runs(signal)) for signal in signals], dtype=bool)


_PLAIN_FAULTS: dict[str, Callable[[FloatArray], BoolArray]] = {
    NOT_A_NUMBER: lambda cut: ~np.isfinite(cut.sum(axis=1)),
    DEAD: lambda cut: np.ptp(cut, axis=1) == 0,
    FROZEN: frozen,
    COPY: _is_copy,
}
"""What the signals of one hit, (channels, samples), show by themselves: which channels have it."""


def _clipped(
    channels: Sequence[Channel], rings: Sequence[FloatArray], sound: BoolArray
) -> BoolArray:
    """Return signals clipped in the free ring-down; in the pulse only the response is spoilt."""
    found = np.zeros(sound.shape, dtype=bool)
    for row, channel in enumerate(channels):
        hits = np.flatnonzero(sound[:, row]).tolist()
        found[hits, row] = clipped([rings[hit][row] for hit in hits], channel.full_scale)
    return found


def _drift(signals: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Return the slow drift of ring-downs (channels, samples): warmth, an amplifier's charge.

    The polynomial of one degree a second, by least squares: of 2 Hz it holds a hundredth of the
    energy, so it is taken off to judge a signal, not to identify it.
    """
    samples = signals.shape[1]
    degree = min(int(samples / sampling_rate_hz), _MOST_DEGREES)
    powers = np.polynomial.legendre.legvander(np.linspace(-1, 1, samples), degree)
    basis = np.linalg.qr(powers)[0]
    return np.asarray(signals @ basis @ basis.T)


def _wanders(part: FloatArray, rate_hz: float) -> BoolArray:
    """Return the channels whose means over 0.5 s move by more than twice the level of the ringing.

    What drifts slowly is no fault: it is taken off.
    """
    block = max(1, int(_OFFSET_SECONDS * rate_hz))
    blocks = part.shape[1] // block
    if blocks < 2:
        return np.zeros(len(part), dtype=bool)
    rest = np.nan_to_num(part) - _drift(np.nan_to_num(part), rate_hz)
    parts = rest[:, : blocks * block].reshape(len(part), blocks, block)
    moves, level = np.ptp(parts.mean(axis=2), axis=1), parts.std(axis=2).max(axis=1)
    return np.asarray(moves > _OFFSET_MOVES * level)


def _surprises(
    free: Sequence[FloatArray], sound: BoolArray, planes: Sequence[Plane | None]
) -> tuple[BoolArray, BoolArray]:
    """Return the hits after which something knocked (hits,), and jumps, bursts, loose contacts.

    A knock is where more than half the channels have them, or those of a plane.
    """
    found = np.zeros(sound.shape)
    for row in range(sound.shape[1]):
        hits = np.flatnonzero(sound[:, row]).tolist()
        if hits:
            found[hits, row] = surprise([free[hit][row] for hit in hits])
    wild = found > _SURPRISE
    groups = [np.array([plane == each for each in planes]) for plane in PLANES]
    groups = [group for group in (*groups, np.full(len(planes), True)) if group.sum() > 1]
    most = [2 * wild[:, group].sum(axis=1) > group.sum() for group in groups]
    return np.any(most, axis=0) if most else np.zeros(len(free), dtype=bool), wild


def clipped(parts: Sequence[FloatArray], full_scale: float) -> BoolArray:
    """Return which parts of one signal, each (samples,), reach the limit of its logger.

    Where the limit is unknown: an extreme value is a limit if three samples have it, and more
    than the values next to it make likely.
    """
    if np.isfinite(full_scale):
        tops = [np.max(np.abs(part), initial=0.0) for part in parts]
        return np.array([top >= FULL_SCALE_SHARE * full_scale for top in tops], dtype=bool)
    return np.asarray(_flat_topped(parts) | _flat_topped([-part for part in parts]))


def clipped_ends(
    channels: Sequence[Channel], ring_downs: Sequence[HitRecord]
) -> list[tuple[int, tuple[str, ...]]]:
    """Return for each hit the first sample without clipping, and the channels clipped before.

    A clipped signal is not the hanger's motion; what follows is. 0 where none is clipped. A
    channel that is clipped beyond half of a ring-down does not count.
    """
    rings = [r.accelerations[:, r.pulse.end : r.pulse.stop] for r in ring_downs]
    ends = [0] * len(rings)
    names: list[list[str]] = [[] for _ in rings]
    for row, channel in enumerate(channels):
        parts = [ring[row] for ring in rings]
        for hit, is_clipped in enumerate(clipped(parts, channel.full_scale)):
            last = _last_clipped(parts[hit], channel.full_scale) if is_clipped else 0
            if 0 < last <= _MOST_CLIPPED * len(parts[hit]):
                ends[hit] = max(ends[hit], ring_downs[hit].pulse.end + last)
                names[hit].append(channel.name)
    return [(end, tuple(each)) for end, each in zip(ends, names, strict=True)]


def _last_clipped(part: FloatArray, full_scale: float) -> int:
    """Return the first sample after those at the limits of the recording."""
    if np.isfinite(full_scale):
        at_limit = np.abs(part) >= FULL_SCALE_SHARE * full_scale
    else:
        at_limit = (part == np.nanmax(part)) | (part == np.nanmin(part))
    return int(np.flatnonzero(at_limit)[-1]) + 1


def _flat_topped(parts: Sequence[FloatArray]) -> BoolArray:
    tops = np.array([part.max(initial=-np.inf) for part in parts])
    top = float(tops.max(initial=-np.inf))
    reaches = tops == top
    repeats = sum(int(np.sum(part == top)) for part, at in zip(parts, reaches, strict=True) if at)
    if repeats < LEAST_REPEATS or not _is_crowded(np.concatenate(parts), repeats):
        return np.zeros(len(parts), dtype=bool)
    return np.asarray(reaches)


def _is_crowded(values: FloatArray, repeats: int) -> bool:
    """Return whether the largest value is far more frequent than each of the ten levels below.

    The crest of a sine, quantised, has its top level 3 to 4 times as often as those; a clipped
    one tens of times. A signal of one level is not clipped, it is dead.
    """
    highest = np.sort(np.partition(values, -_TOP)[-_TOP:] if len(values) > _TOP else values)
    steps = np.diff(highest)
    if not np.any(steps > 0):
        return len(values) > _TOP and float(values.min()) < highest[-1]
    step = float(steps[steps > 0].min())
    below = np.sum(
        (highest < highest[-1]) & (highest >= highest[-1] - (_LEVELS_BELOW + 0.5) * step)
    )
    return bool(repeats > _CROWDED * max(1, below) / _LEVELS_BELOW)


def same_peaks(parts: Sequence[FloatArray]) -> BoolArray:
    """Return which parts of one signal, each (samples,), share their largest value exactly.

    No two hits are equal: what two have in common is the limit of the logger, even where a
    pulse of few samples reaches it once. False where levels are so coarse that chance does it.
    """
    tops = np.array([part.max(initial=-np.inf) for part in parts])
    top = float(tops.max(initial=-np.inf))
    reaches = tops == top
    if np.sum(reaches) < 2:
        return np.zeros(len(parts), dtype=bool)
    steps = np.diff(np.unique(np.concatenate(parts)))
    return np.asarray(reaches & (top > _FINE * float(steps.min(initial=np.inf))))


def _still_runs(signal: FloatArray) -> list[tuple[int, int]]:
    """Return the first and last samples of constant stretches."""
    steps = np.abs(np.diff(signal))
    edges = np.flatnonzero(np.diff(np.concatenate(([0], steps == 0, [0]))))
    runs = [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a + 1 >= FROZEN_SAMPLES]
    if not runs or not np.any(steps > 0):
        return []
    # A slow or weak signal rests on one level of its converter for long: there the samples around
    # move by a few levels (nine around a crest). Where they move by 30, it cannot have rested.
    level = float(steps[steps > 0].min())
    return [(a, b) for a, b in runs if _moves_around(signal, a, b + 1, _MOVES * level)]


def _moves_around(signal: FloatArray, first: int, stop: int, least: float) -> bool:
    length = stop - first
    sides = signal[max(0, first - length) : first], signal[stop : stop + length]
    moves = [float(np.ptp(side)) for side in sides if len(side) >= min(length, FROZEN_SAMPLES)]
    return bool(moves) and min(moves) >= least
