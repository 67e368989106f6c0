"""Windows of an hour, six hours or a day as one reading; its errors allow for what repeats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.monitor.limits import LIMITS
from shm.values import NAN, BoolArray, FloatArray, ModalTest, Mode, Plane, ShapePoint, as_test_id
from shm.values.stream import PERIODS, Period, PooledReading, WindowReading


def pooled(
    readings: Sequence[WindowReading], period: Period, start: datetime
) -> PooledReading | None:
    """Return the windows that begin in a period, as one reading; None where no mode was found.

    Frequencies are at the mean level and temperature of the pooled windows.
    """
    end = start + PERIODS[period]
    inside = sorted(
        (each for each in readings if start <= each.window.start < end),
        key=lambda each: each.window.start,
    )
    chosen = _without_outlying([each for each in inside if each.modes])
    least = max(1, math.ceil(LIMITS.least_share * len(chosen)))
    keys = sorted({(mode.plane, mode.order) for each in chosen for mode in each.modes})
    series = [_Series.of(chosen, *key) for key in keys]
    modes = tuple(each.mode() for each in series if len(each.modes) >= least)
    if not modes:
        return None
    windows = [each.window for each in chosen]
    return PooledReading(
        stream=windows[0].stream,
        hanger=windows[0].hanger,
        start=start,
        period=period,
        modes=modes,
        windows=len(chosen),
        left_out=len(inside) - len(chosen),
        level_m_s2=_mean([each.level_m_s2 for each in windows]),
        temperature_c=_mean([each.temperature_c for each in windows]),
        wind_m_s=_mean([each.wind_m_s for each in windows]),
    )


def as_modal_test(reading: PooledReading) -> ModalTest:
    """Return a pooled reading as a test like any other, in the middle of its period."""
    length = PERIODS[reading.period]
    name = f"{reading.stream}-{reading.start:%Y-%m-%d}"
    if reading.period != "day":
        name += f"T{reading.start:%H}" + ("" if reading.period == "hour" else "-6h")
    return ModalTest(
        id=as_test_id(name),
        modes=reading.modes,
        hanger=reading.hanger,
        time=reading.start + length / 2,
        temperature_c=reading.temperature_c,
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.mean(known)) if known else NAN


def _without_outlying(readings: list[WindowReading]) -> list[WindowReading]:
    """Return the readings without those of which most modes are off what they usually are."""
    if len(readings) < LIMITS.least_to_judge:
        return readings
    off: list[list[float]] = [[] for _ in readings]
    keys = {(mode.plane, mode.order) for each in readings for mode in each.modes}
    for key in sorted(keys):
        series = _Series.of(readings, *key)
        for number, value in zip(series.numbers, np.abs(series.deviations()), strict=True):
            off[number].append(float(value))
    return [
        each
        for each, its in zip(readings, off, strict=True)
        if not its or np.median(its) <= LIMITS.outlying
    ]


@dataclass(frozen=True, eq=False)
class _Series:
    """One mode over the windows in which it was found; `numbers` are theirs; arrays (windows,)."""

    modes: tuple[Mode, ...]
    numbers: tuple[int, ...]
    temperature_c: FloatArray

    @classmethod
    def of(cls, readings: Sequence[WindowReading], plane: Plane, order: int) -> _Series:
        found = [
            (number, mode, each.window.temperature_c)
            for number, each in enumerate(readings)
            for mode in each.modes
            if (mode.plane, mode.order) == (plane, order) and mode.frequency_hz > 0
        ]
        numbers, modes, temperature = zip(*found, strict=True)
        return cls(modes, numbers, np.array(temperature))

    @property
    def hz(self) -> FloatArray:
        return np.array([mode.frequency_hz for mode in self.modes])

    @property
    def sd_hz(self) -> FloatArray:
        """Formal; where one is not known, the largest of the others or 1e-3."""
        sd = np.array([mode.frequency_sd_hz for mode in self.modes])
        known = sd[sd > 0]
        # judgement: what identify allows a frequency
        instead = float(known.max()) if len(known) else 1e-3 * float(np.median(self.hz))
        return np.where(sd > 0, sd, instead)

    def deviations(self) -> FloatArray:
        """From the median, in usual ones."""
        off = self.hz - np.median(self.hz)
        usual = LIMITS.usual_sd * float(np.median(np.abs(off)))
        deviations: FloatArray = off / np.maximum(self.sd_hz, usual)
        return deviations

    def mode(self) -> Mode:
        """Return the mode of all these windows."""
        hz, sd, used = self._regressed()
        chosen = [mode for mode, use in zip(self.modes, used, strict=True) if use]
        damping, damping_sd = _weighted(
            [mode.damping_ratio for mode in chosen], [mode.damping_sd for mode in chosen]
        )
        return replace(
            chosen[-1],
            frequency_hz=hz,
            frequency_sd_hz=math.hypot(sd, LIMITS.repeats * hz),
            damping_ratio=damping,
            damping_sd=damping_sd,
            shape=_mean_shape(chosen),
            acceleration_m_s2=_mean([mode.acceleration_m_s2 for mode in chosen]),
        )

    def _regressed(self) -> tuple[float, float, BoolArray]:
        """Frequency at the mean conditions, its standard deviation, and which windows were used."""
        design, sd = self._design(), self.sd_hz
        used = (
            np.abs(self.deviations()) <= LIMITS.outlying
            if len(sd) >= LIMITS.least_to_judge
            else sd > 0
        )
        # Once more without the windows that what was regressed on does not explain.
        for is_first in (True, False)[: design.shape[1]]:
            weight = np.where(used, sd**-2.0, 0.0)
            inverse = np.linalg.pinv((design.T * weight) @ design)
            found = inverse @ (design.T * weight) @ self.hz
            off = self.hz - design @ found
            if is_first and design.shape[1] > 1:
                usual = LIMITS.usual_sd * float(np.median(np.abs(off[used])))
                used &= np.abs(off) <= LIMITS.outlying * np.maximum(sd, usual)
        freedom = max(1, int(used.sum()) - design.shape[1])
        excess = float(weight @ off**2) / freedom
        together = _together(off[used] / sd[used])
        return float(found[0]), math.sqrt(inverse[0, 0] * max(1.0, excess, excess * together)), used

    def _design(self) -> FloatArray:
        """1, and level and temperature off their means where windows differ in them."""
        level = np.array([mode.acceleration_m_s2 for mode in self.modes])
        columns = [np.ones(len(self.modes))]
        if len(self.modes) >= LIMITS.least_to_regress:
            if np.std(level) > LIMITS.least_spread[0] * np.mean(level):
                columns.append(level / np.mean(level) - 1)
            if np.std(self.temperature_c) > LIMITS.least_spread[1]:
                columns.append(self.temperature_c - np.mean(self.temperature_c))
        return np.array(columns).T


def _together(off: FloatArray) -> float:
    """Windows a window that stands for itself: the variance of means of batches over that of
    independent windows; 1 where there are too few to say.
    """
    if len(off) < LIMITS.least_to_batch:
        return 1.0
    size = max(len(off) // (2 * LIMITS.least_batches), len(off) // int(len(off) ** 0.5))
    count = len(off) // size
    batches = off[: count * size].reshape(count, size).mean(axis=1)
    return size * float(np.var(batches, ddof=1)) / float(np.mean(off**2))


def _weighted(values: Sequence[float], sds: Sequence[float]) -> tuple[float, float]:
    """Mean of positive values by their relative precision; the plain mean where none is known."""
    value, sd = np.array(values), np.array(sds)
    known = (sd > 0) & (value > 0)
    if not known.any():
        return _mean(values), NAN
    weight = (value[known] / sd[known]) ** 2
    log = float(weight @ np.log(value[known]) / weight.sum())
    excess = float(weight @ (np.log(value[known]) - log) ** 2) / max(1, known.sum() - 1)
    return math.exp(log), math.exp(log) * math.sqrt(max(1.0, excess) / float(weight.sum()))


def _mean_shape(modes: Sequence[Mode]) -> tuple[ShapePoint, ...]:
    """Medians by position, of the shapes that have all positions of the last one."""
    positions = [point.x_m for point in modes[-1].shape]
    similar = [mode for mode in modes if [point.x_m for point in mode.shape] == positions]
    if not positions:
        return ()
    values = np.array([[(p.value, p.cross, p.sd) for p in mode.shape] for mode in similar])
    middle = np.median(values, axis=0)
    scatter = LIMITS.usual_sd * np.median(np.abs(values - middle), axis=0)[:, 0]
    formal = middle[:, 2]
    sd = np.maximum(formal, scatter) / math.sqrt(len(similar))
    return tuple(
        ShapePoint(x_m, float(value), float(cross), float(its))
        for x_m, (value, cross, _), its in zip(positions, middle, sd, strict=True)
    )
