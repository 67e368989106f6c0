"""Compare frequencies by wind and traffic with those of hammer tests, on one hanger.

A hammer makes joints slip that small motions do not, its crew brings sensors of some mass, and its
logger has a clock of its own. Where a stream runs on the days of hammer tests, the bias is
measured, so that tests and streams of a hanger can be compared.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta

import numpy as np

from shm.assumptions import DEFAULTS
from shm.values import NAN, ModalTest, Mode
from shm.values.rounding import NINETY_PERCENT, rounded_percent
from shm.values.stream import PooledReading
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.quantities import MeasuredMode

TOGETHER = timedelta(hours=3)
"""Judgement: so long temperature and traffic are alike, and a stream that ran has shown a mode."""


@dataclass(frozen=True)
class AmbientBias:
    """The mean of ln f of a stream less that of `most_tests` hammer tests, and its sd."""

    hanger: int
    common: float = NAN
    common_sd: float = NAN
    most_tests: int = 0

    @property
    def is_known(self) -> bool:
        """Return True if a hammer test was made within three hours of a reading of the stream."""
        return self.most_tests > 0

    def text(self) -> str:
        """Return a sentence for a report."""
        if not self.is_known:
            return (
                f"Hanger {self.hanger}: no hammer test was made within three hours of a reading of "
                "its sensors. Make one while they run, to compare both."
            )
        size = rounded_percent(self.common, NINETY_PERCENT * self.common_sd, "+")
        tests = f"{self.most_tests} test{'s' if self.most_tests > 1 else ''}"
        return (
            f"Hanger {self.hanger}: frequencies by wind and traffic differ from those of hammer "
            f"tests by {size} ({tests})."
        )


def ambient_bias(
    hanger: int, tests: Sequence[ModalTest], readings: Sequence[PooledReading]
) -> AmbientBias:
    """Compare hammer tests with the readings nearest to them in time, by the mean of their modes.

    Tests of other hangers, without a time, or far from any reading are left out.
    """
    known = [each for each in tests if each.hanger in (None, hanger)]
    found = [row for row in (_compare(test, readings) for test in known) if row]
    if not found:
        return AmbientBias(hanger)
    bias, variance = np.array(found).T
    mean = float(np.average(bias, weights=1 / variance))
    misfit = float(np.sum((bias - mean) ** 2 / variance)) / max(len(found) - 1, 1)
    sd = math.sqrt(max(misfit, 1.0) / float(np.sum(1 / variance)))
    return AmbientBias(hanger, mean, sd, len(found))


def _compare(test: ModalTest, readings: Sequence[PooledReading]) -> tuple[float, float] | None:
    """Return the mean of ln f of the stream less that of a test over their modes, its variance."""
    if test.time is None or test.added_mass is not None:
        return None
    time = test.time
    near = [each for each in readings if abs(each.start - time) <= TOGETHER]
    ambient: dict[MeasuredMode, Mode] = {}
    for each in sorted(near, key=lambda each: abs(each.start - time)):
        for mode in each.modes:
            if mode.frequency_hz > 0:
                ambient.setdefault((mode.plane, mode.order), mode)
    pairs = [
        (ambient[key], mode)
        for mode in test.modes
        if mode.frequency_hz > 0 and (key := (mode.plane, mode.order)) in ambient
    ]
    if not pairs:
        return None
    off = [math.log(mode.frequency_hz / its.frequency_hz) for mode, its in pairs]
    variance = [_variance(mode) + _variance(its) + LIMITS.test_scatter**2 for mode, its in pairs]
    return float(np.mean(off)), float(np.sum(variance)) / len(pairs) ** 2


def _variance(mode: Mode) -> float:
    sd = mode.frequency_sd_hz / mode.frequency_hz
    return sd**2 if sd > 0 else DEFAULTS.unstated_frequency_sd.value**2
