"""Which modes of coupled planes belong to which plane."""

from __future__ import annotations

import numpy as np

from shm.values import FloatArray, IntArray

_UNDECIDED = 0.15


def families(transverse_share: FloatArray, modes: int) -> tuple[IntArray, IntArray]:
    """Indices (n, modes) of the transverse and of the longitudinal modes, each ascending.

    `transverse_share` (n, all modes, ascending) of the kinetic energy. A mode belongs to the plane
    that holds more than half. Near principal axes at 45 degrees a pair of neighbours would fall to
    one plane by chance: of two undecided neighbours each plane gets one.
    """
    transverse = transverse_share > 0.5
    undecided = np.abs(transverse_share - 0.5) < _UNDECIDED
    paired = np.zeros(len(transverse_share), dtype=bool)
    for index in range(transverse.shape[1] - 1):
        pair = undecided[:, index] & undecided[:, index + 1] & ~paired
        first = transverse_share[:, index] >= transverse_share[:, index + 1]
        transverse[pair, index] = first[pair]
        transverse[pair, index + 1] = ~first[pair]
        paired = pair
    return _first(transverse, modes), _first(~transverse, modes)


def _first(mine: np.ndarray, modes: int) -> IntArray:
    return np.argsort(~mine, axis=1, kind="stable")[:, :modes]
