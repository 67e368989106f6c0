"""Compute windowed spectra, accelerance (H1, H2, Hv) and coherence from several hits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES, HitRecord
from shm.values import ComplexArray, FloatArray

BAND_MARGIN = 1.25  # both flanks of a mode at the edge, and within 2.56/2 of the thinned signals
MOST_LINES = 8192  # judgement: 65 s of a band of 100 Hz, more than crews wait between hits
END_LEVEL = 0.01
"""A ring-down that is above this share at the end of its window gets an exponential one."""
_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class Window:
    """Define the part of each hit that is used: `length` samples from `before` samples before it.

    The exponential window of `time_constant_s` (inf: none) is on force and accelerations
    equally. It turns the accelerance H(s) into H(s + 1/time constant), whatever the estimator:
    a damping ratio read off it is too high by 1/(2 pi f time constant).
    """

    before: int
    length: int
    time_constant_s: float


@dataclass(frozen=True, eq=False)
class AveragedResponse:
    """The average over hits: `frequency_hz` (lines,), the others (points, lines).

    `coherence` is None for a single hit, where it would be 1 and mean nothing. `spectra` are those
    of each hit, (hits, 1 + points, lines), the force first. All have the exponential window of
    `window_time_constant_s` on them.
    """

    frequency_hz: FloatArray
    accelerance: ComplexArray
    coherence: FloatArray | None
    spectra: ComplexArray
    window_time_constant_s: float


def common_window(
    hits: Sequence[HitRecord], sampling_rate_hz: float, band_high_hz: float
) -> Window:
    """Return the window that suits each of `hits`: cut to one length, rung down at its end."""
    before = min(_margin(sampling_rate_hz), *(hit.pulse.start for hit in hits))
    longest = int(MOST_LINES / (BAND_MARGIN * band_high_hz) * sampling_rate_hz)
    length = min(longest, *(hit.pulse.stop - hit.pulse.start + before for hit in hits))
    constants = [_time_constant(hit, length - before, sampling_rate_hz) for hit in hits]
    return Window(before, length, min(constants))


def averaged_response(
    hits: Sequence[HitRecord],
    sampling_rate_hz: float,
    band_high_hz: float,
    estimator: str = "h1",
    window: Window | None = None,
) -> AveragedResponse:
    """Return accelerance and coherence up to 1.25 times the band, in `window` or one that fits.

    The force window keeps the pulse and fades out after it.
    """
    window = window or common_window(hits, sampling_rate_hz, band_high_hz)
    transform_length = scipy.fft.next_fast_len(window.length, real=True)
    spacing_hz = sampling_rate_hz / transform_length
    lines = 1 + int(min(BAND_MARGIN * band_high_hz, sampling_rate_hz / 2) / spacing_hz)
    spectra = np.array(
        [_spectra(hit, window, transform_length, sampling_rate_hz)[:, :lines] for hit in hits]
    )
    accelerance, coherence = response_of(spectra, estimator)
    return AveragedResponse(
        np.arange(lines, dtype=np.float64) * float(spacing_hz),
        accelerance,
        coherence if len(hits) > 1 else None,
        spectra,
        window.time_constant_s,
    )


def _margin(sampling_rate_hz: float) -> int:
    return int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES


def _time_constant(hit: HitRecord, length: int, sampling_rate_hz: float) -> float:
    """Return that of the window that brings a ring-down to 1 % at its end; inf where it is there.

    `length` is the samples from the hit on: beyond them a gap or the next hit may lie.
    """
    ring_down = hit.accelerations[:, hit.pulse.end : hit.pulse.start + length]
    tenth = max(1, ring_down.shape[1] // 10)
    first, last = np.std(ring_down[:, :tenth]), np.std(ring_down[:, -tenth:])
    if last <= END_LEVEL * first:
        return math.inf
    return float(length / sampling_rate_hz / math.log(last / (END_LEVEL * first)))


def _spectra(
    hit: HitRecord, window: Window, transform_length: int, sampling_rate_hz: float
) -> ComplexArray:
    """Return spectra of the windowed force (row 0) and accelerations, (1 + points, lines)."""
    begin = hit.pulse.start - window.before
    cut = slice(begin, begin + window.length)
    keep = hit.impact_end - begin + _margin(sampling_rate_hz)
    faded = _force_window(window.length, keep)
    rows = np.vstack([hit.force[np.newaxis, cut], hit.accelerations[:, cut]])
    rows[0] -= np.nanmedian(rows[0])
    rows[1:] -= np.nanmean(rows[1:], axis=1, keepdims=True)
    # A hit that is used has bad samples at most before it begins, where nothing is known to move.
    rows[:, : window.before] = np.nan_to_num(rows[:, : window.before])
    rows[0] *= faded
    if math.isfinite(window.time_constant_s):
        rows *= np.exp(-np.arange(window.length) / (window.time_constant_s * sampling_rate_hz))
    return np.asarray(scipy.fft.rfft(rows, n=transform_length, axis=1))


def _force_window(length: int, keep: int) -> FloatArray:
    """Return a window of ones for `keep` samples, then half a cosine to zero over as many."""
    phase = np.clip((np.arange(length) - keep) / keep, 0, 1)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * phase))


def response_of(spectra: ComplexArray, estimator: str) -> tuple[ComplexArray, FloatArray]:
    """Return accelerance in m/s^2/N and coherence, each (points, lines); 0 where nothing is known.

    `spectra` (hits, 1 + points, lines), the force first. `estimator` is `h1`, true where the
    noise is in the responses; `h2`, where it is in the force; `hv`, where both have the same
    share of it (Ewins 2000, section 3.6; Rocklin, Crowley and Vold 1985).
    """
    force, response = spectra[:, :1], spectra[:, 1:]
    cross = np.sum(force.conj() * response, axis=0)
    force_power = np.sum(np.abs(force) ** 2, axis=0)
    response_power = np.sum(np.abs(response) ** 2, axis=0)
    coherence = np.abs(cross) ** 2 / np.maximum(force_power * response_power, _TINY)
    return _ESTIMATORS[estimator](cross, force_power, response_power), coherence


def _h1(cross: ComplexArray, force: FloatArray, response: FloatArray) -> ComplexArray:
    return np.asarray(cross / np.maximum(force, _TINY))


def _h2(cross: ComplexArray, force: FloatArray, response: FloatArray) -> ComplexArray:
    return np.asarray(response * cross / np.maximum(np.abs(cross) ** 2, _TINY))


def _hv(cross: ComplexArray, force: FloatArray, response: FloatArray) -> ComplexArray:
    """Return the total least squares of each response and the force, scaled to unit power.

    Scaled so, the matrix of their spectral densities is [[1, c*], [c, 1]] and the vector of its
    smallest eigenvalue gives a ratio of absolute value 1 and the phase of c: the result does
    not depend on units, and is the geometric mean of H1 and H2.
    """
    ratio = np.sqrt(response / np.maximum(force, _TINY))
    return np.asarray(ratio * cross / np.maximum(np.abs(cross), _TINY))


_ESTIMATORS: dict[str, Callable[[ComplexArray, FloatArray, FloatArray], ComplexArray]] = {
    "h1": _h1,
    "h2": _h2,
    "hv": _hv,
}
