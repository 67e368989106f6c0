"""Which hits of one record struck which plane: half of them across the bridge, half along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.values import PLANES, FloatArray, Plane

_CLEARLY = 4.0
"""Of powers: a hit within 27 degrees of a plane. A crew that means one plane strikes so."""
_FEWEST = 2  # of a plane: one alone may have struck the wrong way


def struck_planes(power: FloatArray, planes: Sequence[Plane | None]) -> dict[Plane, list[int]]:
    """The hits of each plane by the motion after them; empty unless both were struck on purpose.

    `power` (hits, channels) is that of the channels of `planes`.
    """
    if not len(power) or {*PLANES} - {*planes}:
        return {}
    share = {plane: power[:, [own == plane for own in planes]].mean(axis=1) for plane in PLANES}
    one, other = PLANES
    above = share[one] > _CLEARLY * share[other]
    below = share[other] > _CLEARLY * share[one]
    if not np.all(above | below) or min(above.sum(), below.sum()) < _FEWEST:
        return {}
    return {one: np.flatnonzero(above).tolist(), other: np.flatnonzero(below).tolist()}
