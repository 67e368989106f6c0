"""Follow amplitude and phase of each mode through each ring-down, and estimate a common drift.

In each stretch the found poles and shapes are fitted to all channels by least squares.

A logger's clock that drifts, or a hanger that warms up, moves every mode by the same fraction; a
joint or stretching moves each by its amount, equally in every hit of equal strength. With the phase
of a mode in ring-down h, begun at the fraction tau_h of the way from the first hit to the last,

    phase = phase_h + 2 pi f (shift + drift (tau_h - 1/2)) t + 2 pi f slope integral of g,

linear in shift, slope and drift (the laws g of `amplitude_dependence`), each mode gives a drift;
their common part, and how far they differ, is the test's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from shm.identify.contract import Drift, Finding, FoundMode, Hit
from shm.values import ComplexArray, FloatArray
from shm.values.modes import SLOPE_OF_NOTE

_LEAK = 0.01
"""Of a neighbour's motion, at least: comes into a mode's by the error of its shape."""
_RESOLUTION_HZ = 2.0  # one over the half second of a stretch
OVERLAP = math.sqrt(41 / 35)
"""Stretches overlap by half: noise in two neighbours has the correlation 3/35 (the integral of
sin^4 cos^4 over that of sin^8), which makes the variance of a mean 1 + 6/35 times larger."""
_STRETCH_SECONDS = 0.5  # judgement: some periods of most modes; phases turn by little in it
_MOST_STRETCHES = 40  # technical: time
_GROWS = 1.3  # judgement: more than beats of a weak neighbour make
_LEAST_RATIO = 2.0
"""Of an amplitude to its standard deviation: its phase is known to half a radian. With 4 the
median error is a fifth larger."""
_PHASE_SD = 1e-4  # rad, technical: no weight without bound
_RIDGE = 1e-9  # technical: keeps the normal equations solvable
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class RingDownCourse:
    """One ring-down in stretches, whose middles are at `middle_s`.

    `motion` (stretches, modes): complex amplitudes referred to its beginning, with standard
    deviations `sd`.
    """

    middle_s: FloatArray
    motion: ComplexArray
    sd: FloatArray


def course_of(decay: FloatArray, modes: Sequence[FoundMode], rate_hz: float) -> RingDownCourse:
    samples = decay.shape[1]
    hop = max(int(_STRETCH_SECONDS * rate_hz) // 2, samples // _MOST_STRETCHES, 1)
    length = min(2 * hop, samples)
    shapes = np.array([mode.shape for mode in modes])  # (modes, channels)
    omega = 2 * np.pi * np.array([mode.frequency_hz for mode in modes])
    damping = np.array([mode.damping_ratio for mode in modes])
    poles = omega * (-damping + 1j * np.sqrt(1 - damping**2))
    waves = np.exp(np.outer(poles, np.arange(length) / rate_hz))  # (modes, length)
    # Columns Re and -Im of shape times wave, for all channels: the same in every stretch.
    window = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    basis = (shapes[:, :, np.newaxis] * (window * waves)[:, np.newaxis, :]).reshape(len(modes), -1)
    columns = np.vstack([basis.real, -basis.imag])
    gram = columns @ columns.T
    scale = np.sqrt(np.diag(gram))
    inverse = np.linalg.inv(gram / np.outer(scale, scale) + _RIDGE * np.eye(len(gram)))
    inverse /= np.outer(scale, scale)
    parts = sliding_window_view(decay, length, axis=1)[:, ::hop] * window
    flat = parts.transpose(1, 0, 2).reshape(parts.shape[1], -1)
    solved = flat @ columns.T @ inverse  # (stretches, 2 modes)
    rest = flat - solved @ columns
    freedom = max(1, flat.shape[1] - len(columns))
    noise = np.sum(rest**2, axis=1) / freedom
    variance = np.diag(inverse)
    half = len(modes)
    motion = solved[:, :half] + 1j * solved[:, half:]
    begin_s = np.arange(len(flat)) * hop / rate_hz
    hertz = omega / (2 * np.pi)
    unresolved = np.abs(hertz[:, np.newaxis] - hertz) < _RESOLUTION_HZ
    np.fill_diagonal(unresolved, False)
    sd = np.sqrt(np.outer(noise, variance[:half] + variance[half:]) / 2)
    sd = np.hypot(sd, np.sqrt(np.abs(motion * _leaks(modes)) ** 2 @ unresolved))
    turned = np.exp(-np.outer(begin_s, poles))
    middle_s = begin_s + length / (2 * rate_hz)
    return RingDownCourse(middle_s, motion * turned, sd * np.abs(turned))


def _leaks(modes: Sequence[FoundMode]) -> FloatArray:
    """Return the error of each mode's shape over it, (modes,)."""
    shares = [np.linalg.norm(mode.shape_sd) / np.linalg.norm(mode.shape) for mode in modes]
    return np.fmax(np.array(shares), _LEAK)


Row = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Times, phases, their standard deviations; amplitudes referred to the beginning."""


def phases_of(course: RingDownCourse, index: int, decay: float) -> Row | None:
    """Return the stretches from the start in which the mode is above the rest; None for few."""
    motion, sd = course.motion[:, index], course.sd[:, index]
    now = np.abs(motion) * np.exp(-decay * course.middle_s)
    # What grows again is no free decay: something else was heard at its frequency.
    falls = now < _GROWS * np.minimum.accumulate(now)
    clear = falls & (np.abs(motion) > _LEAST_RATIO * sd)
    last = int(np.argmin(clear)) if not np.all(clear) else len(clear)
    if last < 4:
        return None
    phase, size = np.unwrap(np.angle(motion[:last])), np.abs(motion[:last])
    sd = np.maximum(sd[:last] / np.maximum(size, TINY), _PHASE_SD)
    smooth = np.polynomial.Polynomial.fit(course.middle_s[:last], np.log(size), 2, w=1 / sd)
    return course.middle_s[:last], phase, sd, np.exp(smooth(course.middle_s[:last]))


_BY_CHANCE = 0.01
"""Two-sided probability that modes of a steady test, apart by chance alone, agree on a drift: a
check may warn of one sound test in a hundred."""
_LEAST_RING_DOWNS = 2  # of a mode: where each plane is hit in turn, it rings after half of the hits
_WORST = 1e10  # technical: of the condition, so that six digits are left
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


def with_drift(found: Finding, courses: Sequence[RingDownCourse], hits: Sequence[Hit]) -> Finding:
    """Return the finding with its drift; where that is sure, frequencies are known no closer.

    Which end of it is right nobody knows: half of it either way, as far as hits are in the
    middle.
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
    mode: FoundMode, index: int, courses: Sequence[RingDownCourse], shares: FloatArray
) -> tuple[float, float] | None:
    """Return the relative change from first to last hit and its standard deviation.

    A weighted least-squares fit; amplitude and its square absorb the amplitude dependence.
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
    solution = least_squares(matrix, values, weight) if freedom >= 2 else None
    if solution is None:
        return None
    solved, inverse, rest = solution
    at = len(rows)
    variance = inverse[at, at] * max(1.0, float(rest @ rest) / freedom) * OVERLAP**2
    return float(solved[at]), math.sqrt(variance)


def least_squares(
    matrix: FloatArray, values: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Solve `matrix` (values, unknowns) for its unknowns by weighted least squares.

    Returns the unknowns, the inverse of the normal equations and the weighted residuals; None
    where the unknowns cannot be separated.
    """
    weighted = matrix * weight[:, np.newaxis]
    scale = np.linalg.norm(weighted, axis=0)
    if np.any(scale == 0):
        return None
    square = (weighted / scale).T @ (weighted / scale)
    if np.linalg.cond(square) > _WORST:
        return None
    inverse = np.linalg.inv(square) / np.outer(scale, scale)
    solved = inverse @ (weighted.T @ (values * weight))
    return solved, inverse, (values - matrix @ solved) * weight


def _grown(time_s: FloatArray, size: FloatArray, decay: float) -> FloatArray:
    """Return the integral of `size` exp(-`decay` t) from 0 to each time."""
    height = size * np.exp(-decay * time_s)
    areas = np.diff(time_s) * (height[1:] + height[:-1]) / 2
    return np.concatenate(([0.0], np.cumsum(areas)))
