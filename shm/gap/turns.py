"""How much of a shape's standard deviations is that of its direction about the hanger's axis.

Where two planes' frequencies are all but equal, noise turns both shapes at will: every component
errs by the same angle times the other component at its place, so that the larger of a place's two
standard deviations grows with the shape, sd^2 = own^2 + (turn size)^2. Components err independently
by `own` alone.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from shm.values import FloatArray

_FEWEST = 3


def told_apart(sd: FloatArray, size: FloatArray, least: float) -> tuple[FloatArray, float]:
    """The components' own standard deviations (places,) and the turn's, in radians.

    `sd` and `size` (places,) are the larger standard deviation and the larger component of each
    place. Own ones are at least `least`. Where a turn is not most of what the largest component may
    err by it counts as none, for standard deviations scatter, too. Least squares of relative
    errors.
    """
    if len(sd) < _FEWEST:
        return sd, 0.0
    (own, turn), _ = nnls(np.column_stack([np.ones_like(sd), size**2]) / sd[:, None] ** 2, sd / sd)
    if turn * np.max(size**2) <= max(own, least**2):
        return sd, 0.0
    return np.full_like(sd, np.sqrt(max(own, least**2))), float(np.sqrt(turn))
