"""The later part of ring-downs, of a hanger that at first does not ring as a bar does.

A guide with play knocks, a joint slips through, a crack opens: in the first seconds energy wanders
between the modes and no frequency is one. Once the swing has died away below what that takes, the
same hanger rings freely, and its frequencies are those of small amplitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import Measurement
from shm.identify.setup_merging.hit_directions import alike, together
from shm.values import FloatArray

LEFT_OUT = (1 / 4, 1 / 2, 3 / 4)
"""Shares of the ring-downs. Technical: each costs an identification; beyond, noise is left."""
_LOUDNESS = 0.05  # technical: share of a ring-down over which its level is taken


def calmed(measurements: Sequence[Measurement], left_out: float) -> tuple[Measurement, ...]:
    """The measurements without the beginnings of their ring-downs.

    Hits in several directions count together, since what the force says of them went with the
    beginning.
    """
    whole = (together(measurements),) if alike(measurements) else tuple(measurements)
    return tuple(
        replace(each, decays=tuple(_later(decay, left_out) for decay in each.decays), driven=())
        for each in whole
    )


def level_left_at(measurements: Sequence[Measurement], left_out: float) -> float:
    """What a typical ring-down has left of its level where its later part begins."""
    decays = [decay for each in measurements for decay in each.decays]
    left = [_loudness(_later(decay, left_out)) / _loudness(decay) for decay in decays]
    return float(np.median(left))


def _later(decay: FloatArray, left_out: float) -> FloatArray:
    return decay[:, int(left_out * decay.shape[1]) :]


def _loudness(decay: FloatArray) -> float:
    samples = max(1, int(_LOUDNESS * decay.shape[1]))
    return float(np.sqrt(np.mean(decay[:, :samples] ** 2))) or np.finfo(float).tiny
