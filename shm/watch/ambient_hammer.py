"""The bias of frequencies by wind and traffic against those of hammer tests, on one hanger.

A hammer makes joints slip that small motions do not, its crew brings sensors of some mass, and its
logger has a clock of its own. Where a stream runs on the days of hammer tests, the difference is
measured: so that tests and streams of a hanger can be compared.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta

import numpy as np

from shm.assumptions import DEFAULTS
from shm.values import FloatArray, ModalTest, Mode
from shm.values.rounding import NINETY_PERCENT, rounded_percent
from shm.values.stream import PooledReading
from shm.watch.quantities import MeasuredMode

TOGETHER = timedelta(hours=3)
"""Judgement: so long temperature and traffic are alike, and a stream that ran has shown a mode."""
# Of ln f, from one test to the next of a mode: what conditions differ by within TOGETHER, and how
# a crew mounts its sensors (`WatchOptions.mode_scatter`).
_TEST_SCATTER = 5e-4
_BIAS_SD = 2e-3  # before any test: joints slip by 2e-4 to 2e-3 of a frequency. Judgement.


@dataclass(frozen=True, eq=False)
class AmbientBias:
    """ln f of the stream less that of hammer tests: mean and sd (modes,), and of all modes alike.

    `tests` (modes,) is how many tests each rests on.
    """

    hanger: int
    modes: tuple[MeasuredMode, ...]
    mean: FloatArray
    sd: FloatArray
    tests: tuple[int, ...]
    common: float
    common_sd: float

    @property
    def is_known(self) -> bool:
        """Return True if a hammer test ever came within three hours of a reading of the stream."""
        return bool(self.modes)

    @property
    def most_tests(self) -> int:
        """Return how many tests the mode rests on that was compared most often."""
        return max(self.tests, default=0)

    def text(self) -> str:
        """For a report: a sentence, and one of the mode that differs most."""
        if not self.is_known:
            return (
                f"Hanger {self.hanger}: no hammer test was made within three hours of a reading of "
                "its sensors. Make one while they run, to compare both."
            )
        half = NINETY_PERCENT * self.common_sd
        most = int(np.argmax(np.abs(self.mean) / self.sd))
        plane, order = self.modes[most]
        tests = self.most_tests
        its = rounded_percent(self.mean[most], NINETY_PERCENT * self.sd[most], "+")
        return (
            f"Hanger {self.hanger}: frequencies by wind and traffic differ from those of hammer "
            f"tests by {rounded_percent(self.common, half, '+')} ({tests} "
            f"test{'s' if tests > 1 else ''}). Most of all {plane} {order} does, by {its}."
        )


def ambient_bias(
    hanger: int, tests: Sequence[ModalTest], readings: Sequence[PooledReading]
) -> AmbientBias:
    """Of hammer tests and the readings nearest to them in time, mode by mode and shrunk together.

    A mode's own bias is that of all modes and what it differs by: both are normal before any test,
    of 2e-3; the answer is the posterior of all. Tests of other hangers, without a time, or far from
    any reading are left out.
    """
    rows = [
        row for test in tests if test.hanger in (None, hanger) for row in _pairs(test, readings)
    ]
    modes = tuple(sorted({mode for mode, _, _ in rows}))
    if not modes:
        return AmbientBias(hanger, (), np.zeros(0), np.zeros(0), (), math.nan, math.nan)
    n = len(modes)
    at = np.array([modes.index(mode) for mode, _, _ in rows])
    off, weight = np.array([row[1] for row in rows]), 1 / np.array([row[2] for row in rows])
    # The common bias first, then what each mode differs by.
    design = np.hstack([np.ones((n, 1)), np.eye(n)])
    its = np.diag(np.bincount(at, weight, n))
    covariance = np.linalg.inv(design.T @ its @ design + np.eye(n + 1) / _BIAS_SD**2)
    found = covariance @ design.T @ np.bincount(at, weight * off, n)
    of_modes = design @ covariance @ design.T
    # What all modes have on the average says more than the law that they are drawn from.
    mean, average = design @ found, np.full(n, 1 / n)
    return AmbientBias(
        hanger,
        modes,
        mean,
        np.sqrt(np.diag(of_modes)),
        tuple(np.bincount(at, minlength=n).tolist()),
        float(average @ mean),
        math.sqrt(float(average @ of_modes @ average)),
    )


def _pairs(
    test: ModalTest, readings: Sequence[PooledReading]
) -> list[tuple[MeasuredMode, float, float]]:
    """Mode, ln f of the stream less that of the test, its variance; by the nearest reading."""
    if test.time is None or test.added_mass is not None:
        return []
    time = test.time
    near = sorted(
        (each for each in readings if abs(each.start - time) <= TOGETHER),
        key=lambda each: abs(each.start - time),
    )
    hammer = {(mode.plane, mode.order): mode for mode in test.modes if mode.frequency_hz > 0}
    ambient: dict[MeasuredMode, Mode] = {}
    for mode in (mode for each in near for mode in each.modes if mode.frequency_hz > 0):
        ambient.setdefault((mode.plane, mode.order), mode)
    return [
        (
            key,
            math.log(ambient[key].frequency_hz / its.frequency_hz),
            _variance(ambient[key]) + _variance(its) + _TEST_SCATTER**2,
        )
        for key, its in hammer.items()
        if key in ambient
    ]


def _variance(mode: Mode) -> float:
    sd = mode.frequency_sd_hz / mode.frequency_hz
    return sd**2 if sd > 0 else DEFAULTS.unstated_frequency_sd.value**2
