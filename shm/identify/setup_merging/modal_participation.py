"""Fit the found modes to the ring-down after each hit, and to measured responses.

After a hit the acceleration at a point is the real part of a sum of c exp(s t) over the modes, with
s the pole and t from the first sample of the hit's cut. What still rings of the hit before is taken
off. What is left is made by the force, whose transform is F(s): it is phi phi_h s^2 F(s) / (i w_d),
with phi the shape for unit modal mass at the point, phi_h at the hammer, and w_d the damped angular
frequency (Ewins 2000, section 2.4). Force and accelerations have passed the same filter, so its
gain cancels.

An accelerance is the sum over modes of (a + b s) s^2 / (s^2 + 2 zeta w s + w^2), plus a constant
for the modes below the band and a multiple of s^2 for those above (Ewins 2000, section 4.3). An
exponential window of time constant tau puts s = i w + 1/tau.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.identify.contract import FoundMode, Hit, Measurement, poles_of_modes
from shm.identify.options import IdentifyOptions
from shm.values import BoolArray, ComplexArray, FloatArray, FrequencyResponse

_RIDGE = 1e-12
"""Keeps modes that the ring-down is too short to tell apart from growing against each other."""
_AROUND_BAND = 0.02
"""Lines this fraction beyond the band are fitted too, for modes at its edges."""


@dataclass(frozen=True, eq=False)
class Ringing:
    """Hold the result of each used hit for each mode; both arrays are (hits, points, modes).

    `amplitude_m_s2` is that of the mode's acceleration right after the hit. `residue` is the
    shape at the point times that at the hammer, in 1/kg; NaN where the hit before it was not
    used, so that the remaining ringing is unknown.
    """

    amplitude_m_s2: FloatArray
    residue: FloatArray


def ringing(
    measurement: Measurement, modes: Sequence[FoundMode], seen: Sequence[bool] = ()
) -> Ringing:
    """Return amplitudes and residues of `modes` after the used hits of time records.

    Those that were not `seen` here (default: all were) and are too close to one that was have
    none: the ring-down would be divided between the two by chance.
    """
    rings = np.ones(len(modes), bool) if all(seen) else ~_hidden(measurement, modes, seen)
    poles = poles_of_modes(modes)[rings]
    longest = max(signals.shape[1] for signals in measurement.driven)
    waves = np.exp(np.outer(poles, np.arange(longest) / measurement.sampling_rate_hz))
    free = [
        driven.shape[1] - decay.shape[1]
        for driven, decay in zip(measurement.driven, measurement.decays, strict=True)
    ]
    # Complex amplitudes (points, modes) of each ring-down at the first sample of its cut.
    starts = [
        _amplitudes(decay, waves) / waves[:, first]
        for decay, first in zip(measurement.decays, free, strict=True)
    ]
    shape = (len(starts), len(measurement.points), len(modes))
    amplitude, residue = np.zeros(shape), np.zeros(shape)
    for hit, (before, seconds) in enumerate(_before(measurement.hits)):
        old = starts[before] * np.exp(poles * seconds) if before >= 0 else 0.0
        force = measurement.driven[hit][0, : free[hit]]
        peak = int(np.argmax(np.abs(force)))
        transform = (force / measurement.sampling_rate_hz) @ (1 / waves[:, : len(force)]).T
        made = (starts[hit] - old) / transform
        amplitude[hit][:, rings] = np.abs(starts[hit] * waves[:, peak])
        residue[hit][:, rings] = (made * 1j * poles.imag / poles**2).real
    return Ringing(amplitude, residue)


def _hidden(
    measurement: Measurement, modes: Sequence[FoundMode], seen: Sequence[bool]
) -> BoolArray:
    """Return which modes are hidden by one that was seen."""
    frequency_hz, known = np.array([mode.frequency_hz for mode in modes]), np.array(seen)
    samples = max(decay.shape[1] for decay in measurement.decays)
    away = np.abs(np.subtract.outer(frequency_hz, frequency_hz[known]))
    near = away < measurement.sampling_rate_hz / samples
    return np.asarray(~known & near.any(axis=1))


def levels(rings: Sequence[Ringing]) -> FloatArray:
    """Return the amplitude of each mode in m/s^2 right after a hit, (modes,)."""
    medians = [np.median(ring.amplitude_m_s2, axis=0).max(axis=0) for ring in rings]
    return np.asarray(np.max(medians, axis=0))


def with_levels(modes: Sequence[FoundMode], rings: Sequence[Ringing]) -> tuple[FoundMode, ...]:
    """Return the modes with these amplitudes."""
    return tuple(
        replace(mode, acceleration_m_s2=float(level))
        for mode, level in zip(modes, levels(rings), strict=True)
    )


def _amplitudes(decay: FloatArray, waves: ComplexArray) -> ComplexArray:
    """Return least-squares c (points, modes) of decay = Re(c waves), `waves` (modes, samples)."""
    used = waves[:, : decay.shape[1]]
    rows = np.vstack([used.real, -used.imag])
    scale = np.linalg.norm(rows, axis=1, keepdims=True)
    rows = rows / scale
    square = rows @ rows.T + _RIDGE * np.eye(len(rows))
    solved = np.linalg.solve(square, rows @ decay.T) / scale
    return np.asarray(solved[: len(waves)] + 1j * solved[len(waves) :]).T


def _before(hits: Sequence[Hit]) -> list[tuple[int, float]]:
    """Return for each used hit the used hit before it in its record, and the time between.

    -1 where the hanger is taken to have been at rest: no hit came before, or no hit of all
    follows a used one. NaN seconds where the remaining ringing is unknown.
    """
    result = []
    number = -1
    last: Hit | None = None
    for hit in hits:
        before = last if last and last.record == hit.record else None
        if hit.used:
            seconds = hit.start_s - before.start_s if before and before.used else math.nan
            result.append((number, seconds) if before else (-1, 0.0))
            number += 1
        last = hit
    if all(math.isnan(seconds) for _, seconds in result):
        return [(-1, 0.0) for _ in result]
    return result


def fitted(
    measurements: Sequence[Measurement],
    modes: Sequence[Sequence[FoundMode]],
    options: IdentifyOptions,
) -> ComplexArray | None:
    """Return the accelerance (points, lines) of the modes of each set-up; None without a force.

    The factors of each point are the linear least-squares ones over the lines of the band; NaN
    where no line of the band is known.
    """
    parts = [
        _fitted(m.frequency_response, m.window_time_constant_s, each, options)
        for m, each in zip(measurements, modes, strict=True)
        if m.frequency_response is not None
    ]
    return np.vstack(parts) if parts else None


def _fitted(
    response: FrequencyResponse,
    time_constant_s: float,
    modes: Sequence[FoundMode],
    options: IdentifyOptions,
) -> ComplexArray:
    s = np.asarray(2j * np.pi * response.frequency_hz + 1 / time_constant_s, np.complex128)
    basis = _basis(s, modes, 2 * math.pi * options.band_high_hz)
    band = _band(response, options)
    if not band.any():
        return np.full(response.accelerance.shape, np.nan, np.complex128)
    stacked = np.hstack([basis[:, band].real, basis[:, band].imag])
    wanted = np.hstack([response.accelerance[:, band].real, response.accelerance[:, band].imag])
    scale = np.maximum(np.linalg.norm(stacked, axis=1, keepdims=True), np.finfo(float).tiny)
    stacked /= scale
    gram = stacked @ stacked.T + _RIDGE * np.eye(len(stacked))
    factors = np.linalg.solve(gram, stacked @ wanted.T)
    return np.asarray(factors.T @ (basis / scale))


def _basis(s: ComplexArray, modes: Sequence[FoundMode], scale: float) -> ComplexArray:
    """Return two rows a mode and the two residual terms, (2 * modes + 2, lines)."""
    omega = 2 * np.pi * np.array([mode.frequency_hz for mode in modes])[:, None]
    damping = np.array([mode.damping_ratio for mode in modes])[:, None]
    single = s**2 / (s**2 + 2 * damping * omega * s + omega**2)
    return np.vstack([single, single * s / omega, np.ones_like(s), s**2 / scale**2])


def _band(response: FrequencyResponse, options: IdentifyOptions) -> BoolArray:
    frequency_hz: FloatArray = response.frequency_hz
    return np.asarray(
        (frequency_hz >= (1 - _AROUND_BAND) * options.band_low_hz)
        & (frequency_hz <= (1 + _AROUND_BAND) * options.band_high_hz)
        & np.all(np.isfinite(response.accelerance), axis=0)
    )
