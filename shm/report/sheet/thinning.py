"""Fewer vertices for the same picture: of each bin the smallest and the largest value stay."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shm.values import FloatArray, IntArray


def envelope_places(values: FloatArray, bins: int) -> IntArray:
    """Indices of the smallest and the largest of `values` (n,) in each of `bins`, ascending.

    No peak is lost, and every value that is drawn was measured. NaN are passed over; a bin of
    nothing else keeps one, so that the line breaks there. All of a short signal stays.
    """
    if len(values) <= 2 * bins:
        return np.arange(len(values))
    size = -(-len(values) // bins)
    padded = np.full(size * (-(-len(values) // size)), np.nan)
    padded[: len(values)] = values
    rows = padded.reshape(-1, size)
    unknown = np.isnan(rows)
    lowest = np.where(unknown, np.inf, rows).argmin(axis=1)
    highest = np.where(unknown, -np.inf, rows).argmax(axis=1)
    both = np.sort(np.stack([lowest, highest], axis=1), axis=1)
    both += size * np.arange(len(rows))[:, np.newaxis]
    return np.unique(np.minimum(both, len(values) - 1))


def peak_places(values: FloatArray, bins: int) -> IntArray:
    """Indices of the largest finite of `values` (n,) in each of `bins`, ascending."""
    edges = np.unique(np.linspace(0, len(values), bins + 1).astype(np.int64))
    finite = np.where(np.isnan(values), -np.inf, values)
    pairs = pairwise(edges.tolist())
    return np.array([start + int(np.argmax(finite[start:stop])) for start, stop in pairs])
