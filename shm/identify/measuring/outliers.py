"""Which hits disagree with the others: wrong place or direction, or somebody holds the hanger."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES, HitRecord
from shm.values import BoolArray, ComplexArray, FloatArray

LEAST_HITS = 3
"""Of two that differ nobody can say which is right."""
LIMIT = 0.05
_TIMES_OTHERS = 5.0
_PERIODS_OF_BAND = 100.0
_LEAST_SAMPLES = 32
_OTHER_HIT = 0.1
_HARDLY = 0.1


def disagreement(
    hits: Sequence[HitRecord], sampling_rate_hz: float, band_hz: tuple[float, float]
) -> FloatArray:
    """How far each hit's accelerance is from that of the others, (hits,): 0 alike, 1 unlike.

    Of hits j and k over all channels and lines: 1 - |h_j . h_k|^2 / (|h_j|^2 |h_k|^2) (the modal
    assurance criterion, Allemang 1982, of two responses), which a hammer's level and calibration
    do not move; for each hit the lower median over the others. NaN where there are none, for a hit
    whose pulse the record's beginning may cut off, and for one so soon after another that nobody
    can say what of its ring-down is its own.
    """
    apart = np.full(len(hits), np.nan)
    step = _step(hits, sampling_rate_hz, band_hz)
    known = [
        index
        for index, hit in enumerate(hits)
        if hit.pulse.start > 0 and not _comes_too_soon(hit, step)
    ]
    if len(known) < 2:
        return apart
    responses = _responses([hits[index] for index in known], sampling_rate_hz, band_hz, step)
    flat = responses.reshape(len(known), -1)
    level = np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
    alike = np.abs((flat / level) @ (flat / level).conj().T) ** 2
    ordered = np.sort(1 - alike + 2 * np.eye(len(known)), axis=1)
    apart[known] = np.maximum(ordered[:, (len(known) - 2) // 2], 0.0)
    return apart


def outliers(apart: FloatArray) -> BoolArray:
    """The hits that disagree while most of the others agree, (hits,)."""
    judged = apart[np.isfinite(apart)]
    if len(judged) < LEAST_HITS:
        return np.zeros(len(apart), dtype=bool)
    found = apart > max(LIMIT, _TIMES_OTHERS * float(np.median(judged)))
    return np.asarray(found if 2 * np.sum(found) < len(judged) else np.zeros_like(found))


def _step(hits: Sequence[HitRecord], sampling_rate_hz: float, band_hz: tuple[float, float]) -> int:
    """Samples from one spectrum of a ring-down to the next: 100 periods of the highest mode."""
    gap = _gap(sampling_rate_hz)
    room = min((hit.pulse.stop - hit.pulse.start for hit in hits), default=0)
    wanted = int(_PERIODS_OF_BAND / band_hz[1] * sampling_rate_hz)
    return max(min(wanted, room // 3), min(_LEAST_SAMPLES, room)) + gap


def _gap(sampling_rate_hz: float) -> int:
    return int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES


def _comes_too_soon(hit: HitRecord, step: int) -> bool:
    """Is there another hit in the two spectra that foretell what still rings?"""
    before = hit.force[
        max(0, hit.pulse.start - 2 * step) : max(0, hit.pulse.start - RINGING_SAMPLES)
    ]
    return len(before) > 0 and float(np.ptp(before)) > _OTHER_HIT * hit.pulse.peak_force_n


def _responses(
    hits: Sequence[HitRecord], sampling_rate_hz: float, band_hz: tuple[float, float], step: int
) -> ComplexArray:
    """Accelerance of each hit alone without what still rang before it, (hits, channels, lines)."""
    gap = _gap(sampling_rate_hz)
    length = step - gap
    frequency = np.fft.rfftfreq(length, 1 / sampling_rate_hz)
    lines = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    window = np.cos(np.pi / 2 * np.arange(length) / length) ** 2
    return np.array([_response(hit, gap, window)[:, lines] for hit in hits])


def _response(hit: HitRecord, gap: int, window: FloatArray) -> ComplexArray:
    start, length = hit.pulse.start, len(window)
    cut = slice(start, hit.pulse.stop)
    offset = hit.accelerations[:, cut].mean(axis=1, keepdims=True)

    def spectrum(begin: int) -> ComplexArray:
        part = hit.accelerations[:, begin : begin + length] - offset
        return np.asarray(np.fft.rfft(part * window, axis=1))

    after, step = spectrum(start), length + gap
    if start - 2 * step > 0:
        after = after - _carried_on(spectrum(start - 2 * step), spectrum(start - step))
    force = _force_spectrum(hit, gap, length)
    size = np.abs(force)
    # Lines that the hammer hardly excites would be noise over nothing: they fade out instead.
    return after * force.conj() / (size**2 + (_HARDLY * float(size.max())) ** 2)


def _carried_on(earlier: ComplexArray, later: ComplexArray) -> ComplexArray:
    """What two spectra (channels, lines) of one ring-down, a step apart, come to one step on.

    A single mode turns and shrinks by the same factor each step: z2 / z1, here from three lines.
    """
    cross = _three_lines(later * earlier.conj())
    power = np.maximum(_three_lines(np.abs(earlier) ** 2), np.finfo(float).tiny)
    factor = cross / power
    return np.asarray(later * factor / np.maximum(1.0, np.abs(factor)))


def _three_lines(values: ComplexArray | FloatArray) -> ComplexArray:
    padded = np.pad(values, ((0, 0), (1, 1)))
    return np.asarray(padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:])


def _force_spectrum(hit: HitRecord, gap: int, length: int) -> ComplexArray:
    """Of the pulse alone, (lines,)."""
    pulse = hit.pulse
    begin = max(0, pulse.start - gap)
    force = np.zeros(length)
    known = hit.force[pulse.start : min(pulse.end + gap, pulse.start + length)]
    force[: len(known)] = known - np.median(hit.force[begin : pulse.stop])
    return np.asarray(np.fft.rfft(force))
