"""Bands over time, shared by the trends of tension and of stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num

from shm.report.content import HangerReport, Interval, TrendRow
from shm.report.figures import style
from shm.values import FloatArray

_LONE_MARGIN = timedelta(days=1)
_REACH = 3.0


@dataclass(frozen=True)
class Dated:
    """A row of the trend whose time is known."""

    time: datetime
    row: TrendRow


def dated(data: HangerReport) -> list[Dated]:
    """The rows with a time, oldest first."""
    rows = [Dated(row.time, row) for row in data.trend if row.time is not None]
    return sorted(rows, key=lambda row: row.time)


def positions(times: Sequence[datetime]) -> FloatArray:
    """Times as places on a time axis, shape (times,)."""
    return np.asarray(date2num(list(times)), np.float64)  # type: ignore[no-untyped-call]


def band(axes: Axes, points: Sequence[tuple[datetime, Interval]], colour: str, label: str) -> None:
    """Means as a marked line, intervals as a band and (so that one test shows too) as bars."""
    times = positions([time for time, _ in points])
    means = [interval.mean for _, interval in points]
    lows = [interval.low for _, interval in points]
    highs = [interval.high for _, interval in points]
    axes.fill_between(times, lows, highs, color=colour, alpha=0.2, linewidth=0)
    axes.vlines(times, lows, highs, color=colour, linewidth=1, alpha=0.7)
    axes.plot(times, means, color=colour, marker="o", markersize=3.5, linewidth=1.2, label=label)


def dress_time(axes: Axes, times: Sequence[datetime]) -> None:
    """A time axis in UTC; a lone test gets a day either side."""
    locator = AutoDateLocator(tz=UTC, minticks=3, maxticks=8)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    formatter = ConciseDateFormatter(locator, tz=UTC)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_formatter(formatter)
    axes.xaxis.get_offset_text().set_color(style.INK)
    if min(times) == max(times):
        lone = times[0]
        axes.set_xlim(*positions([lone - _LONE_MARGIN, lone + _LONE_MARGIN]))


def inner(values: FloatArray) -> FloatArray:
    """The known ones, those far from the rest drawn near, as of a test that hardly sees a thing.

    For the limits of an axis: (n,) of any unit to (m,), m <= n.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return known
    lower, middle, upper = np.quantile(known, [0.1, 0.5, 0.9])
    reach = _REACH * max(upper - middle, middle - lower)
    return np.asarray(np.clip(known, middle - reach, middle + reach))
