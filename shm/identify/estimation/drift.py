"""Whether all frequencies of a test move together from its first hit to its last.

A logger's clock that drifts, or a hanger that warms up, moves every mode by the same share; a joint
or stretching moves each by its own, and alike in every hit of equal strength. With the phase of a
mode in ring-down h, begun at the share tau_h of the way from the first hit to the last,

    phase = phase_h + 2 pi f (shift + drift (tau_h - 1/2)) t + 2 pi f slope integral of g,

linear in shift, slope and drift (the laws g of `amplitude_dependence`), each mode gives a drift;
what they have in common, and how far they are apart, is the test's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from shm.identify.contract import Drift, Finding, FoundMode, Hit
from shm.identify.estimation.courses import OVERLAP, Course, phases_of
from shm.values import FloatArray
from shm.values.modes import SLOPE_OF_NOTE

_BY_CHANCE = 0.01
"""Two-sided probability that modes of a steady test, apart by chance alone, agree on a drift: a
check may warn of one sound test in a hundred."""
_LEAST_RING_DOWNS = 2  # of a mode: where each plane is hit in turn, it rings after half of the hits
_WORST = 1e10  # technical: of the condition, so that six digits are left
_LEAST_MODES = 3  # two are in the same ratio by chance


def hit_shares(hits: Sequence[Hit]) -> FloatArray:
    """Of each used hit, its share of the way from the first to the last, less a half: (hits,).

    Hits of several records are taken as evenly apart: their files' clocks may not agree.
    """
    used = [hit for hit in hits if hit.used]
    one = len({hit.record for hit in used}) == 1
    at = np.array([hit.start_s if one else n for n, hit in enumerate(used)], dtype=float)
    span = float(np.ptp(at)) if len(at) else 0.0
    return (at - at[0]) / span - 0.5 if span > 0 else np.zeros(len(at))


def common_drift(drifts: Sequence[float], sds: Sequence[float]) -> Drift | None:
    """The mean of what the modes say, weighted; None below three modes.

    What they differ by beyond their own scatter is estimated (DerSimonian and Laird, Controlled
    Clinical Trials 7, 1986), the standard deviation is that of Hartung and Knapp (Statistics in
    Medicine 20, 2001), whose ratio to the mean is Student's with modes - 1 degrees of freedom.
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


def with_drift(found: Finding, courses: Sequence[Course], hits: Sequence[Hit]) -> Finding:
    """The finding with its drift; where that is sure, frequencies are known no closer.

    Which end of it is right nobody knows: half of it either way, as far as hits are in the middle.
    """
    shares = hit_shares(hits)
    if len(shares) != len(courses):
        return found
    seen = [_drift(mode, index, courses, shares) for index, mode in enumerate(found.modes)]
    known = [each for each in seen if each is not None]
    drift = common_drift([value for value, _ in known], [sd for _, sd in known])
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


def _drift(
    mode: FoundMode, index: int, courses: Sequence[Course], shares: FloatArray
) -> tuple[float, float] | None:
    """Relative change from first to last hit and its standard deviation, by weighted least squares.

    Amplitude and its square stand for whatever the frequency owes to them.
    """
    decay = 2 * math.pi * mode.frequency_hz * mode.damping_ratio
    seen = [phases_of(course, index, decay) for course in courses]
    rows = [(row, share) for row, share in zip(seen, shares, strict=True) if row is not None]
    if len(rows) < _LEAST_RING_DOWNS:
        return None
    largest = max(float(row[3][0]) for row, _ in rows)
    blocks = []
    for number, ((time_s, _, _, size), share) in enumerate(rows):
        columns = np.zeros((len(time_s), len(rows) + 4))
        columns[:, number] = 1
        columns[:, -4:] = 2 * math.pi * mode.frequency_hz * np.column_stack([
            share * time_s,
            time_s,
            *(_grown(time_s, (size / largest) ** power, power * decay) for power in (1, 2)),
        ])  # fmt: skip
        blocks.append(columns)
    matrix = np.vstack(blocks)
    values = np.concatenate([row[1] for row, _ in rows])
    weight = 1 / np.concatenate([row[2] for row, _ in rows])
    freedom = len(values) - matrix.shape[1]
    weighted = matrix * weight[:, np.newaxis]
    scale = np.linalg.norm(weighted, axis=0)
    square = (weighted / scale).T @ (weighted / scale)
    if freedom < 2 or np.linalg.cond(square) > _WORST:
        return None
    inverse = np.linalg.inv(square) / np.outer(scale, scale)
    solved = inverse @ (weighted.T @ (values * weight))
    rest = (values - matrix @ solved) * weight
    at = len(rows)
    variance = inverse[at, at] * max(1.0, float(rest @ rest) / freedom) * OVERLAP**2
    return float(solved[at]), math.sqrt(variance)


def _grown(time_s: FloatArray, size: FloatArray, decay: float) -> FloatArray:
    """The integral of `size` exp(-`decay` t) up to each time."""
    height = size * np.exp(-decay * time_s)
    areas = np.diff(time_s) * (height[1:] + height[:-1]) / 2
    return np.concatenate(([0.0], np.cumsum(areas)))
