"""The stretches of a record in which no hammer strikes: there a steady tone stays as it is."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d

from shm.identify.contract import Hit
from shm.identify.measuring.bandlimit import RATE_OVER_BAND
from shm.identify.measuring.hits import RINGING_SAMPLES
from shm.identify.measuring.prediction import thinned
from shm.identify.options import IdentifyOptions
from shm.values import Channel, ComplexArray, FloatArray, Recording

_LEAST_BEFORE_S = 0.25
_LEAST_SAMPLES = 64
_FEW_SEGMENTS = 3
_SEGMENTS_WITHOUT_HITS = 12


@dataclass(frozen=True, eq=False)
class Stretch:
    """Part of a record from sample `first` on, windowed and free of its mean (channels, samples).

    `weight` is the sum of the window: a sine of amplitude 1 has the spectrum weight / 2. `hit`:
    where its hit begins, in samples, NaN where it has none; `force_n`: how hard that was.
    """

    first: int
    signals: FloatArray
    weight: float
    hit: float = math.nan
    force_n: float = 1.0

    def amplitude(self, turns_a_sample: float) -> ComplexArray:
        """Complex amplitude of a sine, referred to the beginning of the record, (channels,)."""
        phase = 2 * np.pi * turns_a_sample * (self.first + np.arange(self.signals.shape[1]))
        parts = self.signals @ np.column_stack((np.cos(phase), -np.sin(phase)))
        return np.asarray((parts[:, 0] + 1j * parts[:, 1]) * 2 / self.weight)


@dataclass(frozen=True, eq=False)
class Stretches:
    """The stretches of a record without a hit in them: each ring-down's later half, and before."""

    later: tuple[Stretch, ...]
    before: Stretch | None
    rate_hz: float
    samples: int


def stretches(
    record: Recording, channels: Sequence[Channel], hits: Sequence[Hit], options: IdentifyOptions
) -> Stretches:
    """The stretches of some channels of a record, thinned to the band."""
    wanted = RATE_OVER_BAND * options.band_high_hz
    factor = max(1, int(record.sampling_rate_hz / wanted))
    rate = record.sampling_rate_hz / factor
    # Twice: two means in a row keep the mains' harmonics from folding back as tones of their own.
    signals = np.array(
        [
            np.nan_to_num(
                thinned(_smoothed(c.values, factor)[np.newaxis], record.sampling_rate_hz, wanted)[0]
            )
            for c in channels
        ]
    )
    margin = int(np.ceil(RINGING_SAMPLES / factor)) + 1
    starts = [hit.start // factor for hit in hits]
    spans = _spans(starts, margin, signals.shape[1])
    struck = [hits[bisect(starts, a) - 1] if hits else None for a, _ in spans]
    later = tuple(
        _stretch(signals, a, b)
        if hit is None
        else replace(_stretch(signals, a, b), hit=hit.start / factor, force_n=abs(hit.peak_force_n))
        for (a, b), hit in zip(spans, struck, strict=True)
        if b - a >= _LEAST_SAMPLES
    )
    quiet = starts[0] - margin if starts else 0
    known = quiet >= _LEAST_BEFORE_S * rate
    before = _stretch(signals, 0, quiet) if known else None
    return Stretches(later, before, rate, signals.shape[1])


def _smoothed(values: FloatArray, samples: int) -> FloatArray:
    """Running means over as many samples as are thinned to one."""
    return np.asarray(uniform_filter1d(values, samples)) if samples > 1 else values


def _spans(starts: Sequence[int], margin: int, samples: int) -> list[tuple[int, int]]:
    """First and last sample of each ring-down's later half, in thirds where there are few."""
    ends = [*(start - margin for start in starts[1:]), samples]
    spans = [((a + b) // 2, b) for a, b in zip(starts, ends, strict=True)] if starts else []
    if len(spans) >= _FEW_SEGMENTS:
        return spans
    if not spans:
        return _divided(0, samples, _SEGMENTS_WITHOUT_HITS)
    return [pair for a, b in spans for pair in _divided(a, b, _FEW_SEGMENTS)]


def _divided(first: int, stop: int, parts: int) -> list[tuple[int, int]]:
    return list(pairwise(np.linspace(first, stop, parts + 1).astype(int).tolist()))


def _stretch(signals: FloatArray, first: int, stop: int) -> Stretch:
    part, window = signals[:, first:stop], np.hanning(stop - first)
    centred = part - part.mean(axis=1, keepdims=True)
    return Stretch(first, centred * window, float(window.sum()))
