"""What the found modes make of a measured frequency response.

An accelerance is the sum over modes of (a + b s) s^2 / (s^2 + 2 zeta w s + w^2), plus a constant
for the modes below the band and a multiple of s^2 for those above (Ewins 2000, section 4.3). An
exponential window of time constant tau puts s = i w + 1/tau.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.identify.contract import FoundMode, Measurement
from shm.identify.options import IdentifyOptions
from shm.values import BoolArray, ComplexArray, FloatArray, FrequencyResponse

_RIDGE = 1e-12
_AROUND_BAND = 0.02
"""Lines this fraction beyond the band are fitted too, for modes at its edges."""


def fitted(
    measurements: Sequence[Measurement],
    modes: Sequence[Sequence[FoundMode]],
    options: IdentifyOptions,
) -> ComplexArray | None:
    """The accelerance (points, lines) that the modes of each set-up make; None without a force.

    The factors of each point are the linear least-squares ones over the lines of the band.
    """
    parts = [
        _fitted(m.frequency_response, m.window_time_constant_s, own, options)
        for m, own in zip(measurements, modes, strict=True)
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
    stacked = np.hstack([basis[:, band].real, basis[:, band].imag])
    wanted = np.hstack([response.accelerance[:, band].real, response.accelerance[:, band].imag])
    scale = np.maximum(np.linalg.norm(stacked, axis=1, keepdims=True), np.finfo(float).tiny)
    stacked /= scale
    gram = stacked @ stacked.T + _RIDGE * np.eye(len(stacked))
    factors = np.linalg.solve(gram, stacked @ wanted.T)
    return np.asarray(factors.T @ (basis / scale))


def _basis(s: ComplexArray, modes: Sequence[FoundMode], scale: float) -> ComplexArray:
    """Two rows a mode and the two residual terms, (2 * modes + 2, lines)."""
    omega = 2 * np.pi * np.array([[mode.frequency_hz] for mode in modes])
    damping = np.array([[mode.damping_ratio] for mode in modes])
    single = s**2 / (s**2 + 2 * damping * omega * s + omega**2)
    return np.vstack([single, single * s / omega, np.ones_like(s), s**2 / scale**2])


def _band(response: FrequencyResponse, options: IdentifyOptions) -> BoolArray:
    frequency_hz: FloatArray = response.frequency_hz
    return np.asarray(
        (frequency_hz >= (1 - _AROUND_BAND) * options.band_low_hz)
        & (frequency_hz <= (1 + _AROUND_BAND) * options.band_high_hz)
        & np.all(np.isfinite(response.accelerance), axis=0)
    )
