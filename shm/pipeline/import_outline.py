"""The picture of a channel over time that an import shows."""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray

OUTLINE_BINS = 32
"""Into how many parts of equal length the picture of a channel divides it."""


def outline(values: FloatArray | None) -> tuple[float, ...]:
    """The largest departure from the middle in each part, as a share of the largest of all."""
    if values is None or len(values) < OUTLINE_BINS or not np.isfinite(values).any():
        return ()
    middle = float(np.nanmedian(values))
    away = np.nan_to_num(np.abs(values - middle), posinf=0.0)
    parts = np.array([part.max() for part in np.array_split(away, OUTLINE_BINS)])
    top = float(parts.max())
    return tuple(float(part) for part in (parts / top if top > 0 else parts))
