"""Accelerance H1 and coherence from the ring-downs of several hits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from shm.identify.hits import PULSE_SECONDS, RINGING_SAMPLES, HitRecord
from shm.values import ComplexArray, FloatArray

BAND_MARGIN = 1.25
MOST_LINES = 8192
END_LEVEL = 0.01
"""A ring-down that is above this share at the end of its window gets an exponential one."""


@dataclass(frozen=True, eq=False)
class AveragedResponse:
    """H1 over hits: `frequency_hz` (lines,), `accelerance` and `coherence` (channels, lines).

    `coherence` is None for a single hit, where it would be 1 and mean nothing. The exponential
    window of time constant `window_time_constant_s` (inf: none) lay on force and accelerations
    alike; a damping ratio read off these curves is too high by 1/(2 pi f time constant).
    """

    frequency_hz: FloatArray
    accelerance: ComplexArray
    coherence: FloatArray | None
    window_time_constant_s: float


def averaged_response(
    hits: Sequence[HitRecord], sampling_rate_hz: float, band_high_hz: float
) -> AveragedResponse:
    """H1 = S_fa / S_ff and coherence up to 1.25 times the band; (Ewins 2000, 3.6 and 3.9).

    The force window keeps the pulse and fades out after it. All hits are cut to one length.
    """
    before = min(_margin(sampling_rate_hz), *(hit.pulse.start for hit in hits))
    longest = int(MOST_LINES / (BAND_MARGIN * band_high_hz) * sampling_rate_hz)
    length = min(longest, *(hit.pulse.stop - hit.pulse.start + before for hit in hits))
    time_constant = min(_time_constant(hit, length, sampling_rate_hz) for hit in hits)
    window = np.exp(-np.arange(length) / (time_constant * sampling_rate_hz))
    transform_length = next_fast_len(length, real=True)
    spacing_hz = sampling_rate_hz / transform_length
    lines = 1 + int(min(BAND_MARGIN * band_high_hz, sampling_rate_hz / 2) / spacing_hz)
    spectra = [
        _spectra(hit, before, window, transform_length, sampling_rate_hz)[:, :lines] for hit in hits
    ]
    accelerance, coherence = _h1(np.array(spectra))
    return AveragedResponse(
        np.arange(lines, dtype=np.float64) * float(spacing_hz),
        accelerance,
        coherence if len(hits) > 1 else None,
        time_constant,
    )


def _margin(sampling_rate_hz: float) -> int:
    return int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES


def _time_constant(hit: HitRecord, length: int, sampling_rate_hz: float) -> float:
    """Of the window that brings a ring-down to 1 % at its end; inf where it is there already."""
    ring_down = hit.accelerations[:, hit.pulse.end : hit.pulse.start + length]
    tenth = max(1, ring_down.shape[1] // 10)
    first, last = np.std(ring_down[:, :tenth]), np.std(ring_down[:, -tenth:])
    if last <= END_LEVEL * first:
        return math.inf
    return float(length / sampling_rate_hz / math.log(last / (END_LEVEL * first)))


def _spectra(
    hit: HitRecord, before: int, window: FloatArray, transform_length: int, sampling_rate_hz: float
) -> ComplexArray:
    """Spectra of the windowed force (row 0) and accelerations, (1 + channels, lines)."""
    begin = hit.pulse.start - before
    cut = slice(begin, begin + len(window))
    keep = hit.pulse.end - begin + _margin(sampling_rate_hz)
    force = hit.force[cut] - np.median(hit.force[cut])
    offset = np.mean(hit.accelerations[:, cut], axis=1, keepdims=True)
    rows = np.vstack([force * _force_window(len(window), keep), hit.accelerations[:, cut] - offset])
    return np.asarray(np.fft.rfft(rows * window, n=transform_length, axis=1))


def _force_window(length: int, keep: int) -> FloatArray:
    """One for `keep` samples, then half a cosine down to zero over as many."""
    phase = np.clip((np.arange(length) - keep) / keep, 0, 1)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * phase))


def _h1(spectra: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """H1 and coherence of spectra (hits, 1 + channels, lines); 0 where there is no force."""
    force, response = spectra[:, :1], spectra[:, 1:]
    tiny = np.finfo(float).tiny
    cross = np.sum(force.conj() * response, axis=0)
    force_power = np.maximum(np.sum(np.abs(force) ** 2, axis=0), tiny)
    response_power = np.maximum(np.sum(np.abs(response) ** 2, axis=0), tiny)
    return cross / force_power, np.abs(cross) ** 2 / (force_power * response_power)
