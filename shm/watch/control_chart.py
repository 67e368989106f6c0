"""Chart the tests of a hanger of known tension: does a campaign measure as it should."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from shm.values import ControlHanger


@dataclass(frozen=True)
class ControlReading:
    """One test of a control hanger: the tension by its modes, and the known one, in N.

    `sd_n` is absolute, `repeatability_sd_n` what one test differs by from the next.
    """

    test: str
    time: datetime
    tension_n: float
    sd_n: float
    repeatability_sd_n: float
    known_n: float


@dataclass(frozen=True)
class ControlPoint:
    """A test on the chart: fractions of the known tension, each with its standard deviation.

    `centre` is the deviation that is expected by all tests before, `limit` the half width about it.
    """

    reading: ControlReading
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
            point
            for point in reversed(self.points)
            if point.is_out and abs(point.reading.time - time).total_seconds() <= 86400 * days
        )
        return next(near, None)


def chart_control(
    hanger: ControlHanger, readings: Sequence[ControlReading], limit_sds: float = 3.0
) -> ControlChart:
    """Chart the readings of a control hanger, in the order of their times (record 0028).

    A deviation is a constant bias (the bar's description, the known tension) and the
    repeatability of its test. The bias is learnt from the tests within limits (a Kalman filter of
    a constant), so that the first test is judged by its absolute uncertainty (a zeta score) and
    later ones by how well a test repeats. `limit_sds` are those of an action limit of Shewhart.

    References
    ----------
    ISO 7870-2:2023, Shewhart control charts; ISO 13528:2022, section 9.6, zeta scores.
    """
    points: list[ControlPoint] = []
    bias, variance = 0.0, math.nan
    for each in sorted(readings, key=lambda reading: reading.time):
        absolute, repeats = each.sd_n / each.known_n, each.repeatability_sd_n / each.known_n
        repeats = repeats if math.isfinite(repeats) else absolute
        if math.isnan(variance):
            of_reference = hanger.known_tension_sd_n / hanger.known_tension_n
            variance = of_reference**2 + max(absolute**2 - repeats**2, 0.0)
        spread = variance + repeats**2
        limit = limit_sds * math.sqrt(spread)
        point = ControlPoint(each, each.tension_n / each.known_n - 1, repeats, bias, limit)
        points.append(point)
        if not point.is_out:
            gain = variance / spread
            bias, variance = bias + gain * (point.deviation - bias), (1 - gain) * variance
    return ControlChart(hanger, tuple(points))
