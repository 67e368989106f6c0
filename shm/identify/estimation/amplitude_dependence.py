"""How each mode's frequency depends on its amplitude, from the course of its phase.

A joint that slips lowers a frequency while the hanger swings far, stretching raises it. With
f(A) = f0 (1 + c (A / A_hit)^p) and A falling as exp(-s t), the phase of a mode that is turned back
by a constant frequency f is, by the method of averaging (Nayfeh and Mook 1979, chapter 2),

    phase = phase_0 + 2 pi (f0 - f) t + 2 pi f0 c (A_0 / A_hit)^p (1 - exp(-p s t)) / (p s),

linear in f0 - f and c. Phases come from stretches of the ring-downs, in each of which the found
poles and shapes are fitted to all channels by least squares; p is 1 (friction) or 2 (stretching),
whichever fits better.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import ndtri, stdtrit

from shm.identify.contract import Finding, FoundMode, Measurement
from shm.values import NAN, ComplexArray, FloatArray
from shm.values.modes import MOST_SLOPE, SURE_SDS

_LEAST_SLOPE = 2e-5
"""Relative. A phase is known so well that a clock's shaking would show; no one needs less."""
_TO_ZERO = 0.01
"""Of a slope: by how much the frequency of small amplitude is off by the law's form at most. In
tests/identify/test_amplitude_dependence.py 1 % of a slope of 1e-3 is four standard deviations of
all else; in the trial below nothing hangs on it."""
_SLOPE_ERROR = 0.05
"""Of a slope: how the law looks in the first instants is carried back from later ones (judgement).
It is in the slope's standard deviation alone."""

# What follows is tried by tests/benchmarks/identify_ablation.py on 176 modes of hangers that soften
# or harden: 90 % intervals of the frequencies cover 92 %, and 74 % where frequencies stay as they
# were found, whose errors are then twice as large.
_UNSEEN = 2.0
"""Times what others shift: one that is not seen in the phases may shift more. 89 % without."""
_LAW_ERROR = 0.15
"""Of a shift: friction and stretching differ by so much where both fit. 85 % without."""
_SOME = 0.2
"""Share of the modes that must be sure, for others to be corrected, too. 85 % if they never are."""
_OVERLAP = 2.0
"""Stretches overlap by half: so much less is known than they seem to say. 81 % without."""
_STRETCH_SECONDS = 0.5  # judgement: some periods of most modes; phases turn by little in it
_MOST_STRETCHES = 40  # technical: time
_LEAST_RATIO = 2.0
"""Of an amplitude to its standard deviation: its phase is known to half a radian. With 4 the
median error is a fifth larger."""
_RIDGE = 1e-9  # technical: keeps the normal equations solvable
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class _Course:
    """One ring-down in stretches, whose middles are at `middle_s`.

    `motion` (stretches, modes): complex amplitudes referred to its beginning, with standard
    deviations `sd`.
    """

    middle_s: FloatArray
    motion: ComplexArray
    sd: FloatArray


@dataclass(frozen=True)
class _Fit:
    shift_hz: float
    shift_sd_hz: float
    slope: float
    slope_sd: float
    misfit: float

    @property
    def is_sure(self) -> bool:
        return is_sure(self.slope, self.slope_sd)


def is_sure(slope: float, sd: float) -> bool:
    """Whether a frequency depends on amplitude by more than chance and less than nonsense."""
    return max(SURE_SDS * sd, _LEAST_SLOPE) < abs(slope) < MOST_SLOPE


def with_amplitude_dependence(found: Finding, measurement: Measurement) -> Finding:
    """The finding with the slope of each mode's frequency, and where it is sure, the frequency of
    small amplitude instead of the mean one."""
    if not found.modes or not measurement.hits:
        return found
    courses = [
        _course(decay, found.modes, measurement.sampling_rate_hz) for decay in measurement.decays
    ]
    leads_s = _leads_s(measurement)
    fits = [_fits(mode, index, courses, leads_s) for index, mode in enumerate(found.modes)]
    sure = [
        fit.shift_hz / mode.frequency_hz
        for mode, fit in zip(found.modes, fits, strict=True)
        if fit is not None and fit.is_sure
    ]
    known = [fit for fit in fits if fit is not None]
    # Where several depend on amplitude, the others will too, by about as much.
    several = len(sure) > _SOME * len(known)
    usual = float(np.sqrt(np.mean(np.square(sure)))) if several else 0.0
    # A joint that slips lowers all frequencies, stretching raises all.
    expected = float(np.median(sure)) if several else 0.0
    modes = tuple(
        _with_slope(mode, fit, expected, usual) for mode, fit in zip(found.modes, fits, strict=True)
    )
    return replace(found, modes=modes)


def _with_slope(mode: FoundMode, fit: _Fit | None, expected: float, usual: float) -> FoundMode:
    """The mode with its slope and shift; by `expected` +- `usual`, relative, it is shifted where
    its own phase says nothing."""
    slope = (fit.slope, fit.slope_sd) if fit is not None else (NAN, NAN)
    known = replace(mode, amplitude_slope=slope[0], amplitude_slope_sd=slope[1])
    prior_hz = usual * mode.frequency_hz
    if fit is None or abs(fit.slope) > MOST_SLOPE:
        return replace(known, frequency_sd_hz=math.hypot(mode.frequency_sd_hz, _UNSEEN * prior_hz))
    # Beside what the other modes shift, a shift that is not sure by itself counts by its share.
    vague = 0.0 if fit.is_sure else fit.shift_sd_hz**2
    share = 1.0 if fit.is_sure else prior_hz**2 / (prior_hz**2 + vague + _TINY)
    shift_hz = share * fit.shift_hz + (1 - share) * expected * mode.frequency_hz
    by_phase = math.hypot(
        math.sqrt(share) * fit.shift_sd_hz,
        _LAW_ERROR * shift_hz,
        _TO_ZERO * fit.slope * mode.frequency_hz,
    )
    as_found = mode.frequency_sd_hz if math.isnan(mode.damping_sd) else 0.0
    kept = (1 - share) * mode.frequency_sd_hz
    return replace(
        known,
        frequency_hz=mode.frequency_hz + shift_hz,
        frequency_sd_hz=max(as_found, math.hypot(by_phase, kept)),
    )


def _leads_s(measurement: Measurement) -> list[float]:
    """Of each ring-down, how long before it begins the hammer struck; 0 where nobody knows."""
    if not measurement.driven:
        return [0.0] * len(measurement.decays)
    leads = []
    for driven, decay in zip(measurement.driven, measurement.decays, strict=True):
        free = driven.shape[1] - decay.shape[1]
        struck = int(np.argmax(np.abs(driven[0, :free]))) if free else 0
        leads.append((free - struck) / measurement.sampling_rate_hz)
    return leads


def _course(decay: FloatArray, modes: Sequence[FoundMode], rate_hz: float) -> _Course:
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
    sd = np.sqrt(np.outer(noise, variance[:half] + variance[half:]) / 2)
    turned = np.exp(-np.outer(begin_s, poles))
    middle_s = begin_s + length / (2 * rate_hz)
    return _Course(middle_s, motion * turned, sd * np.abs(turned))


def _fits(
    mode: FoundMode, index: int, courses: Sequence[_Course], leads_s: Sequence[float]
) -> _Fit | None:
    """The better of the two laws; None where too little of the phase is known."""
    decay = 2 * math.pi * mode.frequency_hz * mode.damping_ratio
    seen = [_phases(course, index) for course in courses]
    rows = [row for row in seen if row is not None]
    if not rows:
        return None
    starts = np.array([start for *_, start in rows])
    leads = np.array([lead for lead, row in zip(leads_s, seen, strict=True) if row is not None])
    usual = float(np.median(starts * np.exp(decay * leads)))
    laws = [_fit(mode, rows, starts / usual, decay, power) for power in (1, 2)]
    known = [law for law in laws if law is not None]
    return min(known, key=lambda law: law.misfit, default=None)


_Row = tuple[FloatArray, FloatArray, FloatArray, float]
"""Times, phases, their standard deviations; the amplitude at the beginning."""


def _phases(course: _Course, index: int) -> _Row | None:
    """Of the stretches from the beginning on in which the mode stands out of the rest."""
    motion, sd = course.motion[:, index], course.sd[:, index]
    clear = np.abs(motion) > _LEAST_RATIO * sd
    last = int(np.argmin(clear)) if not np.all(clear) else len(clear)
    if last < 4:
        return None
    phase = np.unwrap(np.angle(motion[:last]))
    size = np.abs(motion[:last])
    return course.middle_s[:last], phase, sd[:last] / np.maximum(size, _TINY), float(size[0])


def _fit(
    mode: FoundMode, rows: Sequence[_Row], starts: FloatArray, decay: float, power: int
) -> _Fit | None:
    """Weighted least squares: a phase for each ring-down, the shift and the slope for all."""
    count = len(rows)
    design, phases, weights = [], [], []
    for number, ((time_s, phase, sd, _), start) in enumerate(zip(rows, starts, strict=True)):
        columns = np.zeros((len(time_s), count + 2))
        columns[:, number] = 1
        columns[:, count] = 2 * np.pi * time_s
        grown = -np.expm1(-power * decay * time_s) / (power * decay)
        columns[:, count + 1] = 2 * np.pi * mode.frequency_hz * start**power * grown
        design.append(columns)
        phases.append(phase)
        weights.append(1 / np.maximum(sd, 1e-4))
    matrix, values, weight = np.vstack(design), np.concatenate(phases), np.concatenate(weights)
    freedom = len(values) - matrix.shape[1]
    if freedom < 2:
        return None
    weighted = matrix * weight[:, np.newaxis]
    scale = np.linalg.norm(weighted, axis=0)
    if np.any(scale == 0):
        return None
    square = (weighted / scale).T @ (weighted / scale)
    if np.linalg.cond(square) > 1e10:
        return None
    inverse = np.linalg.inv(square) / np.outer(scale, scale)
    solved = inverse @ (weighted.T @ (values * weight))
    misfit = float(np.sum(((matrix @ solved - values) * weight) ** 2))
    widening = float(stdtrit(freedom, 0.95) / ndtri(0.95))
    spread = np.sqrt(np.diag(inverse) * misfit / freedom) * widening * _OVERLAP
    return _Fit(
        float(solved[count]),
        float(spread[count]),
        float(solved[count + 1]),
        math.hypot(float(spread[count + 1]), _SLOPE_ERROR * float(solved[count + 1])),
        misfit,
    )
