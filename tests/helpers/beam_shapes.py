"""One mode shape of a tensioned beam on springs, scaled as a picture shows it."""

from __future__ import annotations

import numpy as np

from shm.models.classes.tensioned_beam import shapes, waves
from shm.values import FloatArray


def mode_shape(xi: float, ka: float, kb: float, order: int, x: FloatArray) -> FloatArray:
    """Return the shape at `x` (points,) from 0 to 1, largest value 1, its first lobe positive."""
    deck = np.array([float(ka)])
    along = waves(np.array([float(xi) ** 2]), deck, np.array([float(kb)]), order)
    fine = np.linspace(0, 1, 40 * order + 1)
    found = shapes(along, deck[:, None], np.append(x, fine))[0, -1]
    of_fine = found[len(x) :]
    return np.asarray(found[: len(x)] / np.copysign(np.abs(of_fine).max(), of_fine[20]))
