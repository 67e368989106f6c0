"""Estimate the drift that all frequencies of a test share from its first hit to its last.

A logger's clock that drifts, or a hanger that warms up, moves every mode by the same fraction; a
joint or stretching moves each by its amount, equally in every hit of equal strength. Each mode's
phases give a drift; their common part, and how far they differ, is the test's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from shm.identify.contract import Drift, Finding, Hit
from shm.values import FloatArray
from shm.values.modes import SLOPE_OF_NOTE

_BY_CHANCE = 0.01
"""Two-sided probability that modes of a steady test, apart by chance alone, agree on a drift: a
check may warn of one sound test in a hundred."""
_LEAST_MODES = 3  # two are in the same ratio by chance


def hit_shares(hits: Sequence[Hit]) -> FloatArray:
    """Return the position of each used hit between first and last, minus a half: (hits,).

    Hits of several records are taken as evenly spaced: their files' clocks may not agree.
    """
    used = [hit for hit in hits if hit.used]
    one = len({hit.record for hit in used}) == 1
    at = np.array([hit.start_s if one else n for n, hit in enumerate(used)], dtype=float)
    span = float(np.ptp(at)) if len(at) else 0.0
    return (at - at[0]) / span - 0.5 if span > 0 else np.zeros(len(at))


def common_drift(drifts: Sequence[float], sds: Sequence[float]) -> Drift | None:
    """Return the weighted mean of the modes' drifts; None below three modes.

    The variance between modes beyond their scatter is estimated (DerSimonian and Laird,
    Controlled Clinical Trials 7, 1986), the standard deviation is that of Hartung and Knapp
    (Statistics in Medicine 20, 2001), whose ratio to the mean is Student's with modes - 1
    degrees of freedom.
    """
    value, sd = np.array(drifts), np.array(sds)
    if len(value) < _LEAST_MODES:
        return None
    weight = sd**-2.0
    apart = weight @ (value - weight @ value / weight.sum()) ** 2
    room = weight.sum() - weight @ weight / weight.sum()
    weight = 1 / (sd**2 + max(0.0, (apart - (len(value) - 1)) / room))
    mean = float(weight @ value / weight.sum())
    scatter = max(1.0, float(weight @ (value - mean) ** 2) / (len(value) - 1))
    mean_sd = math.sqrt(scatter / weight.sum())
    quantile = float(scipy.special.stdtrit(len(value) - 1, 1 - _BY_CHANCE / 2))
    sure = abs(mean) > max(quantile * mean_sd, SLOPE_OF_NOTE)
    return Drift(mean, mean_sd, len(value), sure)


def with_drift(found: Finding, drifts: Sequence[tuple[float, float]]) -> Finding:
    """Return the finding with its drift; where that is sure, frequencies are known no closer.

    `drifts` are those of single modes with standard deviations. Which end of it is right nobody
    knows: half of it either way, as far as hits are in the middle.
    """
    drift = common_drift([value for value, _ in drifts], [sd for _, sd in drifts])
    if drift is None or not drift.sure:
        return replace(found, drift=drift)
    modes = tuple(
        replace(
            mode,
            frequency_sd_hz=math.hypot(mode.frequency_sd_hz, drift.change / 2 * mode.frequency_hz),
        )
        for mode in found.modes
    )
    return replace(found, modes=modes, drift=drift)
