"""Estimate how each mode's frequency depends on its amplitude, from the course of its phase.

A joint that slips lowers a frequency while the hanger swings far, stretching raises it. With f(A) =
f0 (1 + c g(A / A_hit)), the phase of a mode that is rotated back by a constant frequency f is, by
the method of averaging (Nayfeh and Mook 1979, chapter 2),

    phase = phase_0 + 2 pi (f0 - f) t + 2 pi f0 c integral of g(A / A_hit) dt,

linear in f0 - f and c. Phases and amplitudes A come from stretches of the ring-downs, in
each of which the found poles and shapes are fitted to all channels by least squares. Laws g are
friction (A), stretching (A^2) and joints that slip no further (A / (A + h)), averaged by how well
they fit: where a ring-down ends before it is small, they differ in the limit of zero, and the
interval widens.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.identify.contract import LEAST_HITS, Finding, FoundMode, Measurement
from shm.identify.estimation.courses import (
    OVERLAP,
    TINY,
    RingDownCourse,
    Row,
    course_of,
    phases_of,
)
from shm.identify.estimation.spread import are_sure, widening
from shm.values import NAN, FloatArray
from shm.values.modes import MOST_SLOPE

_SLOPE_ERROR = 0.05
"""Of a slope: how the law looks in the first instants is carried back from later ones (judgement).
It is in the slope's standard deviation alone."""

# 90 % intervals of 463 modes in records that soften or harden cover 96 %, those as found 70 %:
# identify_ablation.py --seeds 9510:9522, as what is said of other constants
_LAW_ERROR = 0.2
"""Of the change that is left where ring-downs end: what no law here foretells (judgement)."""
_HALVES = (0.1, 0.3, 1.0)
"""Of A_hit: h. Above, it is friction; below, ring-downs end before it shows (judgement)."""
_INDEPENDENT = 8.0
"""Values among the phases, at most: what no law here explains is alike in all ring-downs."""
_UNLIKE = 0.17
"""Of the rate by which a mode's amplitude falls otherwise than its pole says: so much its frequency
may be off. A chirp that was found as a mode of thrice its damping is off by that."""
_MAX_MISFIT = 0.1
"""Radians by which phases leave a law, the surer ones counting more: then it is something else that
turns them. A law that is wrong by a tenth of 0.5 % leaves 0.03 in a second of 20 Hz."""
_FINE = 16  # technical: steps of the integral a stretch
_WORST = 1e10  # technical: of the condition, so that six digits are left


@dataclass(frozen=True)
class _Fit:
    """Hold what the phases of one mode give.

    `left` is the relative change of the frequency that is left where the ring-downs end.
    """

    shift_hz: float
    shift_sd_hz: float
    slope: float
    slope_sd: float
    left: float
    misfit: float
    freedom: int


def with_amplitude_dependence(found: Finding, measurement: Measurement) -> Finding:
    """Return the finding with the slope of each mode's frequency over its amplitude.

    Where the slope is sure, the frequency is that of small amplitude instead of the mean.
    """
    if not found.modes or not measurement.hits:
        return found
    courses = [
        course_of(decay, found.modes, measurement.sampling_rate_hz) for decay in measurement.decays
    ]
    leads_s = _leads_s(measurement)
    fits = [_fits(mode, index, courses, leads_s) for index, mode in enumerate(found.modes)]
    slopes = np.array([(NAN, NAN) if fit is None else (fit.slope, fit.slope_sd) for fit in fits])
    sure = are_sure(*slopes.T)
    shifts = [
        fit.shift_hz / mode.frequency_hz
        for mode, fit, is_sure in zip(found.modes, fits, sure, strict=True)
        if fit is not None and is_sure
    ]
    # Where several depend on amplitude, the others will too, by about as much.
    usual = float(np.sqrt(np.mean(np.square(shifts)))) if len(shifts) > 1 else 0.0
    # A joint that slips lowers all frequencies, stretching raises all.
    expected = float(np.median(shifts)) if len(shifts) > 1 else 0.0
    modes = tuple(
        _unlike(_with_slope(mode, fit, bool(is_sure), expected, usual), index, courses, mode)
        for index, (mode, fit, is_sure) in enumerate(zip(found.modes, fits, sure, strict=True))
    )
    return replace(found, modes=modes)


def _with_slope(
    mode: FoundMode, fit: _Fit | None, is_sure: bool, expected: float, usual: float
) -> FoundMode:
    """Return the mode with its slope and shift.

    Where its phase gives none, it is shifted by `expected` +- `usual`, as fractions.
    """
    slope = (fit.slope, fit.slope_sd) if fit is not None else (NAN, NAN)
    known = replace(mode, amplitude_slope=slope[0], amplitude_slope_sd=slope[1])
    prior_hz = usual * mode.frequency_hz
    if fit is None or abs(fit.slope) > MOST_SLOPE:
        # A line that is as broad as the frequency moves looks damped by as much.
        return replace(
            known,
            frequency_sd_hz=math.hypot(mode.frequency_sd_hz, prior_hz),
            damping_sd=math.hypot(mode.damping_sd, usual),
        )
    # Beside what the other modes shift, a shift that is not sure by itself counts by its share.
    vague = 0.0 if is_sure else fit.shift_sd_hz**2
    share = 1.0 if is_sure else prior_hz**2 / (prior_hz**2 + vague + TINY)
    shift_hz = share * fit.shift_hz + (1 - share) * expected * mode.frequency_hz
    by_phase = math.hypot(
        math.sqrt(share) * fit.shift_sd_hz, share * _LAW_ERROR * fit.left * mode.frequency_hz
    )
    as_found = mode.frequency_sd_hz if math.isnan(mode.damping_sd) else 0.0
    remaining_sd = (1 - share) * mode.frequency_sd_hz
    return replace(
        known,
        frequency_hz=mode.frequency_hz + shift_hz,
        frequency_sd_hz=max(as_found, math.hypot(by_phase, remaining_sd)),
    )


def _leads_s(measurement: Measurement) -> list[float]:
    """Return the time from the hammer's hit to the start of each ring-down; 0 if unknown."""
    if not measurement.driven:
        return [0.0] * len(measurement.decays)
    leads = []
    for driven, decay in zip(measurement.driven, measurement.decays, strict=True):
        free = driven.shape[1] - decay.shape[1]
        at_hit = int(np.argmax(np.abs(driven[0, :free]))) if free else 0
        leads.append((free - at_hit) / measurement.sampling_rate_hz)
    return leads


def _fits(
    mode: FoundMode,
    index: int,
    courses: Sequence[RingDownCourse],
    leads_s: Sequence[float],
) -> _Fit | None:
    """Return the estimate averaged over the laws; None where too little of the phase is known."""
    decay = 2 * math.pi * mode.frequency_hz * mode.damping_ratio
    seen = [phases_of(course, index, decay) for course in courses]
    at = [number for number, row in enumerate(seen) if row is not None]
    rows = [row for row in seen if row is not None]
    if not rows:
        return None
    leads = np.array(leads_s)[at]
    starts = np.array([size[0] for *_, size in rows])
    at_hit = float(np.median(starts * np.exp(decay * leads)))
    laws = [_fit(mode, [_through(row, decay, law, at_hit) for row in rows]) for law in LAWS]
    fit = _averaged([law for law in laws if law is not None])
    if fit is None:
        return None
    return replace(fit, shift_sd_hz=math.hypot(fit.shift_sd_hz, _UNLIKE * _unlike_hz(rows)))


def _unlike_hz(rows: Sequence[Row]) -> float:
    """Return how far the decay of the amplitudes differs from the pole's, in Hz."""
    off = [math.log(size[-1] / size[0]) / (time_s[-1] - time_s[0]) for time_s, _, _, size in rows]
    return abs(float(np.median(off))) / (2 * math.pi)


def _unlike(
    mode: FoundMode, index: int, courses: Sequence[RingDownCourse], as_found: FoundMode
) -> FoundMode:
    """Widen the mode's intervals where its amplitudes decay otherwise than its pole does.

    A clipped beginning causes that, for example.
    """
    decay = 2 * math.pi * as_found.frequency_hz * as_found.damping_ratio
    late = [_from_largest(course, index, decay) for course in courses]
    seen = [row for course in late if (row := phases_of(course, index, decay)) is not None]
    off_hz = _unlike_hz(seen) if seen else 0.0
    return replace(
        mode,
        damping_sd=math.hypot(mode.damping_sd, off_hz / mode.frequency_hz),
        frequency_sd_hz=math.hypot(mode.frequency_sd_hz, _UNLIKE * off_hz),
    )


def _from_largest(course: RingDownCourse, index: int, decay: float) -> RingDownCourse:
    now = np.abs(course.motion[:, index]) * np.exp(-decay * course.middle_s)
    first = int(np.argmax(now[: max(1, len(now) // 2)]))
    return RingDownCourse(course.middle_s[first:], course.motion[first:], course.sd[first:])


def _averaged(laws: Sequence[_Fit]) -> _Fit | None:
    """Average the fits of all laws by their likelihood; differences add to the variances."""
    if not laws:
        return None
    best = min(laws, key=lambda law: law.misfit)
    worse = np.array([law.misfit for law in laws]) / max(best.misfit, TINY)
    weight = worse ** (-min(best.freedom / OVERLAP, _INDEPENDENT) / 2)
    weight /= weight.sum()
    values = np.array([(law.shift_hz, law.slope, law.left) for law in laws])
    sds = np.array([(law.shift_sd_hz, law.slope_sd, 0.0) for law in laws])
    mean = weight @ values
    shift_sd, slope_sd, left_sd = np.sqrt(weight @ (sds**2 + (values - mean) ** 2)).tolist()
    left = math.hypot(mean[2], left_sd)
    return replace(
        best, shift_hz=float(mean[0]), shift_sd_hz=shift_sd,
        slope=float(mean[1]), slope_sd=slope_sd, left=left,
    )  # fmt: skip


_Grown = tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]
"""Times, phases, standard deviations, the law's integral up to each time; the law at the end."""

_Law = Callable[[FloatArray], FloatArray]


def _slips_no_further(half: float) -> _Law:
    return lambda size: size * (1 + half) / (size + half)


LAWS: tuple[_Law, ...] = (
    lambda size: size,
    lambda size: size**2,
    *(_slips_no_further(half) for half in _HALVES),
)
"""How a frequency falls with the amplitude: dry friction, stretching, and a joint that slips."""


def _through(row: Row, decay: float, law: _Law, at_hit: float) -> _Grown:
    time_s, phase, sd, size = row
    fine_s = np.linspace(time_s[0], time_s[-1], _FINE * (len(time_s) - 1) + 1)
    amplitude = np.exp(np.interp(fine_s, time_s, np.log(size)) - decay * fine_s) / at_hit
    height = law(amplitude)
    areas = np.diff(fine_s) * (height[1:] + height[:-1]) / 2
    grown = np.concatenate(([0.0], np.cumsum(areas)))
    return time_s, phase, sd, grown[::_FINE], float(height[-1])


def _fit(mode: FoundMode, rows: Sequence[_Grown]) -> _Fit | None:
    """Fit a phase for each ring-down, and shift and slope for all, by weighted least squares."""
    count, turns = len(rows), 2 * np.pi * mode.frequency_hz
    time_s, values, sds, grown = (np.concatenate([row[n] for row in rows]) for n in range(4))
    of_row = np.repeat(np.arange(count), [len(row[0]) for row in rows])
    weight = 1 / sds
    weighted = weight[:, np.newaxis] * np.column_stack([
        of_row[:, np.newaxis] == np.arange(count), 2 * np.pi * time_s, turns * grown,
    ])  # fmt: skip
    freedom, scale = len(values) - weighted.shape[1], np.linalg.norm(weighted, axis=0)
    if freedom < 2 or np.any(scale == 0):
        return None
    square = (weighted / scale).T @ (weighted / scale)
    if np.linalg.cond(square) > _WORST:
        return None
    inverse = np.linalg.inv(square) / np.outer(scale, scale)
    solved = inverse @ (weighted.T @ (values * weight))
    left_over = values * weight - weighted @ solved
    misfit = float(left_over @ left_over)
    if misfit > (_MAX_MISFIT * np.linalg.norm(weight)) ** 2:
        return None
    chance = math.sqrt(max(1.0, misfit / freedom)) * OVERLAP
    by_hits = _by_ring_downs(weighted, left_over, inverse, rows)
    spread = np.fmax(np.sqrt(np.diag(inverse)) * chance * widening(freedom), by_hits)
    slope = float(solved[count + 1])
    return _Fit(
        shift_hz=float(solved[count]),
        shift_sd_hz=float(spread[count]),
        slope=slope,
        slope_sd=math.hypot(float(spread[count + 1]), _SLOPE_ERROR * slope),
        left=slope * float(np.median([row[4] for row in rows])),
        misfit=misfit,
        freedom=freedom,
    )


def _by_ring_downs(
    weighted: FloatArray, left_over: FloatArray, inverse: FloatArray, rows: Sequence[_Grown]
) -> FloatArray:
    """Return standard deviations from the residuals of each ring-down; NaN for fewer than three.

    The sandwich of Liang and Zeger (Biometrika 73, 1986) with ring-downs as clusters.
    """
    count = len(rows)
    if count < LEAST_HITS:
        return np.full(len(inverse), np.nan)
    ends = np.cumsum([len(row[0]) for row in rows])[:-1]
    scores = np.array([
        part.T @ rest
        for part, rest in zip(np.split(weighted, ends), np.split(left_over, ends), strict=True)
    ])  # fmt: skip
    squares = np.sum((scores @ inverse) ** 2, axis=0)
    return np.asarray(np.sqrt(squares * count / (count - 1)) * widening(count - 1))
