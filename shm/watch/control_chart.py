"""Chart the tests of a hanger of known tension: does a campaign measure as it should."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from shm.values import ControlHanger, Summary


@dataclass(frozen=True)
class ControlPoint:
    """A test on the chart: its tension and the known one in N, and the deviation as a fraction.

    `sd` is what deviations scatter by from test to test, `centre` what is expected by all tests
    before, `limit` the half width about it.
    """

    test: str
    time: datetime
    tension_n: float
    known_n: float
    deviation: float
    sd: float
    centre: float
    limit: float

    @property
    def is_out(self) -> bool:
        """Return True if it is out of its limits, or if its deviation is not known."""
        return not abs(self.deviation - self.centre) <= self.limit


@dataclass(frozen=True)
class ControlChart:
    """All tests of a control hanger, the oldest first."""

    hanger: ControlHanger
    points: tuple[ControlPoint, ...] = ()

    @property
    def latest(self) -> ControlPoint | None:
        return self.points[-1] if self.points else None

    def out_near(self, time: datetime, days: float) -> ControlPoint | None:
        """Return the latest test out of its limits within so many days of a time; else None."""
        near = (
            each for each in self.points if abs(each.time - time).total_seconds() <= 86400 * days
        )
        return next((each for each in reversed(list(near)) if each.is_out), None)


def chart_control(
    hanger: ControlHanger,
    tests: Sequence[tuple[str, datetime, Summary, float, float]],
    limit_sds: float = 3.0,
) -> ControlChart:
    """Chart tests by name, time, absolute tension, its repeatability and the known one, in N.

    A deviation is a constant bias, the repeatability of its test, and what tensions differ by from
    test to test (`tension_between_tests` of the assumptions). Tests within limits teach
    the bias (a Kalman filter of a constant): the first is judged by its zeta score (ISO
    13528:2022, 9.6), later ones as on a chart of Shewhart (ISO 7870-2:2023). See record 0028.
    """
    points: list[ControlPoint] = []
    between = hanger.assumptions.tension_between_tests.value
    bias, variance = 0.0, math.nan
    for test, time, tension, repeatability_n, known_n in sorted(tests, key=lambda each: each[1]):
        absolute, repeats = tension.sd / known_n, repeatability_n / known_n
        repeats = math.hypot(repeats if math.isfinite(repeats) else absolute, between)
        if math.isnan(variance):
            reference = hanger.known_tension_sd_n / hanger.known_tension_n
            variance = reference**2 + max(absolute**2 - repeats**2, 0.0)
        spread, deviation = variance + repeats**2, tension.mean / known_n - 1
        limit = limit_sds * math.sqrt(spread)
        made = ControlPoint(test, time, tension.mean, known_n, deviation, repeats, bias, limit)
        points.append(made)
        if not made.is_out:
            bias += variance / spread * (deviation - bias)
            variance *= repeats**2 / spread
    return ControlChart(hanger, tuple(points))
