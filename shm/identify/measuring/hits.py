"""Find the hammer hits in a force signal, at its full sampling rate, and the plane of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.values import PLANES, FloatArray, IntArray, Plane

# judgement: normal noise reaches 5 sigmas once in a million samples, mains and steps of a converter
# somewhat more; a second blow is sought only where one has struck, so that less may count
HIT_SIGMAS = 10.0
DOUBLE_SIGMAS = 8.0
# judgement: crews' hits differ by a factor of two or three; a tenth is the hammer put down
LEAST_SHARE_OF_HARDEST = 0.1
DOUBLE_SHARE = 0.02  # judgement: drives the response by 2 %, what one hit's scatter hides
PULSE_SECONDS = 0.006  # judgement: soft tips on steel push for 3 to 5 ms, hard ones for 1 to 2
GROUP_SECONDS = 0.5
"""Peaks closer than this are one swing of the hammer, not two hits."""
RINGING = 0.4
"""An anti-aliasing filter rings around a pulse by about this share over the distance in samples."""
RINGING_SAMPLES = 16
"""So long before a hit its ringing may stand out of the noise: the ring-down before ends there."""
_REACH, _STEPS = 12, 33
"""Samples to either side from which a peak between samples is interpolated, and at how many places.
"""
# judgement: forty pulses long, so that a hit does not move its median; drift is slower
_BASELINE_SECONDS = 0.25
_BASELINE_SAMPLES = 64


@dataclass(frozen=True)
class Pulse:
    """One hit in samples: force above the noise from `start` up to `end`, quiet up to `stop`.

    `stop` is shortly before the next blow, be it too weak for a hit, or where the record ends.
    `second_peak` is the largest share of the peak force that strikes again in the same swing, and
    `second_end` the first sample after that; both 0 where none does.
    """

    start: int
    peak: int
    end: int
    stop: int
    peak_force_n: float
    second_peak: float = 0.0
    second_end: int = 0


@dataclass(frozen=True, eq=False)
class HitRecord:
    """The hit of `pulse` in its record: `force` (samples,), `accelerations` (channels, samples).

    `clipped_end` is the first sample from which no acceleration is clipped any more, 0 where none
    is in the ring-down; `cut`: why it ends before the next hit.
    """

    force: FloatArray
    accelerations: FloatArray
    pulse: Pulse
    clipped_end: int = 0
    cut: str = ""

    @property
    def free(self) -> int:
        """The first sample at which the hanger rings freely and is recorded as it rings."""
        return max(self.impact_end, self.clipped_end)

    @property
    def impact_end(self) -> int:
        """The first sample at which nothing strikes any more."""
        return max(self.pulse.end, self.pulse.second_end)


def find_pulses(force: FloatArray, sampling_rate_hz: float) -> list[Pulse]:
    """Find the hits in `force` (samples,), NaN where bad; empty where none exceeds the noise.

    A hit is 10 standard deviations of the noise and a tenth of the hardest hit above a slow
    baseline, in the direction of the largest excursion: a hammer only pushes.
    """
    if np.sum(np.isfinite(force)) < _BASELINE_SAMPLES:
        return []
    push, noise = _push(force, sampling_rate_hz)
    level = max(HIT_SIGMAS * noise, LEAST_SHARE_OF_HARDEST * float(push.max(initial=0.0)))
    # A pulse may begin with the record: a zero on either side makes its edge a peak, and of a flat
    # top the first sample. `scipy.signal` takes longer to load than all hits to be found.
    steps = np.diff(np.concatenate(([0.0], push, [0.0])))
    moves = np.flatnonzero(steps)
    peaks = moves[:-1][(steps[moves[:-1]] > 0) & (steps[moves[1:]] < 0)]
    peaks = peaks[push[peaks] >= level]
    if not len(peaks):
        return []
    groups = grouped(peaks.tolist(), int(GROUP_SECONDS * sampling_rate_hz))
    starts = [_start(push, group[0], noise) for group in groups]
    margin = int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES
    stops = [*(start - margin for start in starts[1:]), len(push)]
    return [
        _pulse(push, group, start, stop, noise, sampling_rate_hz)
        for group, start, stop in zip(groups, starts, stops, strict=True)
    ]


def _push(force: FloatArray, sampling_rate_hz: float) -> tuple[FloatArray, float]:
    """Return force over its slow baseline, hits positive, 0 where NaN; and the noise in it."""
    good = np.isfinite(force)
    filled = np.where(good, force, np.median(force[good]))
    above = filled - _baseline(filled, sampling_rate_hz)
    low, high = np.quantile(above, [0.05, 0.95])
    noise = max(1.4826 * float(np.median(np.abs(above))), float(high - low) / 3.29)
    sign = 1.0 if above.max() >= -above.min() else -1.0
    return np.where(good, sign * above, 0.0), noise


def _baseline(signal: FloatArray, sampling_rate_hz: float) -> FloatArray:
    """Return medians of blocks joined by straight lines: follows drift, not hits."""
    block = max(_BASELINE_SAMPLES, int(_BASELINE_SECONDS * sampling_rate_hz))
    blocks = max(2, len(signal) // block)
    parts = np.array_split(signal, blocks)
    levels = np.array([np.median(part) for part in parts])
    # Half a block before the first middle and after the last, the lines are carried on.
    ends = (levels[0] - (levels[1] - levels[0]) / 2, levels[-1] + (levels[-1] - levels[-2]) / 2)
    knots = np.concatenate(([0.0], np.arange(blocks) + 0.5, [blocks])) * len(signal) / blocks
    return np.asarray(np.interp(np.arange(len(signal)), knots, [ends[0], *levels, ends[1]]))


def grouped(peaks: list[int], distance: float) -> list[list[int]]:
    """Return rising samples in groups, each nearer than `distance` to the one before it."""
    groups: list[list[int]] = []
    for peak in peaks:
        if groups and peak - groups[-1][-1] < distance:
            groups[-1].append(peak)
        else:
            groups.append([peak])
    return groups


def _start(push: FloatArray, peak: int, noise: float) -> int:
    """Return the first sample of the rise to `peak`."""
    quiet = np.flatnonzero(push[:peak] < _quiet(push[peak], noise))
    return int(quiet[-1]) + 1 if len(quiet) else 0


def _quiet(peak_force: float, noise: float) -> float:
    return max(DOUBLE_SHARE * peak_force, 5 * noise)


def _pulse(
    push: FloatArray, peaks: list[int], start: int, stop: int, noise: float, rate: float
) -> Pulse:
    # Peaks this near to the first are its ringing, or it is theirs.
    near = [peak for peak in peaks if peak - peaks[0] <= _same_pulse(rate)]
    first = max(near, key=lambda peak: float(push[peak]))
    falls = np.flatnonzero(push[first:stop] < _quiet(push[first], noise))
    end = first + int(falls[0]) if len(falls) else stop
    hardest = max(_between_samples(push, peak) for peak in peaks)
    again = first + _second_impacts(push[first:stop], end - first, noise, rate)
    apart = again[again > peaks[-1] + int(GROUP_SECONDS * rate)]
    if len(apart):  # too weak for a hit, and no second blow of this one
        stop = int(apart[0]) - int(PULSE_SECONDS * rate) - RINGING_SAMPLES
        again = again[again < stop]
    if not len(again):
        return Pulse(start, first, end, stop, hardest)
    second = float(np.max(push[again]) / push[first])
    return Pulse(start, first, end, stop, hardest, second, int(again[-1]) + 1)


def _between_samples(push: FloatArray, peak: int) -> float:
    """Return the peak of a band-limited pulse, interpolated between samples."""
    first = max(0, peak - _REACH)
    part = push[first : peak + _REACH + 1]
    nodes = np.arange(len(part))
    offsets = peak - first + np.linspace(-1, 1, _STEPS)[:, np.newaxis] - nodes
    taper = np.cos(np.pi * np.clip(offsets / (_REACH + 1), -1, 1) / 2) ** 2
    return float(max(push[peak], np.max((np.sinc(offsets) * taper) @ part)))


def _same_pulse(sampling_rate_hz: float) -> int:
    return max(int(PULSE_SECONDS * sampling_rate_hz), RINGING_SAMPLES)


def _second_impacts(
    after: FloatArray, fall: int, noise: float, sampling_rate_hz: float
) -> IntArray:
    """Return the samples of `after`, from the first peak on, at which another impact begins.

    Up to 6 ms after the peak, and until it has fallen after `fall` samples (a soft tip's pulse
    is long), it is the same pulse; then 2 % of the peak and 8 sigma count, and more close to
    the pulse, where the ringing of an anti-aliasing filter is still above 2 %. Its peak may lie
    half a sample later than the first that is recorded.
    """
    skip = max(1, fall, int(np.ceil(PULSE_SECONDS * sampling_rate_hz)))
    ringing = RINGING / (np.arange(skip, len(after)) - 0.5)
    limit = np.maximum(after[0] * np.maximum(DOUBLE_SHARE, ringing), DOUBLE_SIGMAS * noise)
    return np.asarray(skip + np.flatnonzero(after[skip:] > limit))


_CLEARLY = 4.0
"""Of powers: a hit within 27 degrees of a plane. A crew that means one plane strikes so."""
_FEWEST = 2  # of a plane: one alone may have struck the wrong way


def hits_by_plane(power: FloatArray, planes: Sequence[Plane | None]) -> dict[Plane, list[int]]:
    """Return the hits of each plane by the motion after them; empty unless both were hit.

    `power` (hits, channels) is that of the channels of `planes`.
    """
    if not len(power) or {*PLANES} - {*planes}:
        return {}
    share = {plane: power[:, [each == plane for each in planes]].mean(axis=1) for plane in PLANES}
    one, other = PLANES
    above = share[one] > _CLEARLY * share[other]
    below = share[other] > _CLEARLY * share[one]
    if not np.all(above | below) or min(above.sum(), below.sum()) < _FEWEST:
        return {}
    return {one: np.flatnonzero(above).tolist(), other: np.flatnonzero(below).tolist()}
