"""What the logger makes of its lines: noise, clipping, steps of its converter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shm.values import Channel, FloatArray, Plane, Quantity


@dataclass(frozen=True, eq=False)
class Line:
    """One sensor's cable at the logger's input: `values` (samples,) without the logger's noise.

    The converter's codes span `full_range` to either side; beyond `limit` the signal saturates.
    """

    name: str
    quantity: Quantity
    values: FloatArray
    plane: Plane | None
    x_m: float
    noise_sd: float
    full_range: float
    limit: float = math.inf


def logged(line: Line, bits: int, rng: np.random.Generator) -> Channel:
    """A line with white noise, quantised to `bits` over plus and minus its range, clipped."""
    codes = 2 ** (bits - 1)
    step = line.full_range / codes
    noisy = line.values + line.noise_sd * rng.standard_normal(len(line.values))
    held = np.clip(np.round(noisy / step), -codes, codes - 1) * step
    values = np.clip(held, -line.limit, line.limit)
    return Channel(line.name, line.quantity, values, line.plane, line.x_m)
