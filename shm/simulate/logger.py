"""What the logger makes of a signal: noise, clipping, steps of its converter."""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray


def log(
    signal: FloatArray, noise_sd: float, full_range: float, bits: int, rng: np.random.Generator
) -> FloatArray:
    """A signal (samples,) with white noise, quantised to `bits` over +- `full_range`, clipped."""
    codes = 2 ** (bits - 1)
    step = full_range / codes
    noisy = signal + noise_sd * rng.standard_normal(len(signal))
    return np.asarray(np.clip(np.round(noisy / step), -codes, codes - 1) * step)
