"""The stated rate of false calls, and what it rests on: the statistic's mean is the time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shm.values import FloatArray, Reading
from shm.watch.options import WatchOptions
from tests.helpers.synthetic_readings import BOTH_ENDS, START, History, tension, watch_of

WEAK_STEP = 0.001
"""A change much below the scatter: then the statistic's mean is not that of a few large values."""


def years(readings: list[Reading], index: int) -> float:
    return (readings[index].time - START).total_seconds() / 86400 / 365.25


def statistics(history: History, options: WatchOptions, n: int) -> FloatArray:
    """Years watched and the statistic (n, 2) of n hangers without change, never called."""
    found = []
    for seed in range(n):
        readings = history.readings(seed)
        result = watch_of(readings, history.quantities, options).tests[-1].change
        # The last test alone speaks for no change: its time is not counted.
        found.append((years(readings, -2) - years(readings, 0), result.evidence_years))
    return np.array(found)


@pytest.mark.trial
@pytest.mark.parametrize("beginnings", [40, 8])
def test_without_change_the_statistic_is_the_time_watched_on_average(beginnings: int) -> None:
    history = History((tension(WEAK_STEP),), tests=16, days_between=30, scatter=0.003, outliers=0)
    options = WatchOptions(
        limit_years=math.inf,
        tension_scatter=0.003,
        spring_scatter_of_step=0.06,
        scatter_scales=(1.0,),
        beginnings=beginnings,
    )

    time, statistic = statistics(history, options, 100).T

    error = np.std(statistic - time) / math.sqrt(len(time))
    assert error < 0.2 * time.mean()
    assert abs(np.mean(statistic - time)) < 3 * error


@pytest.mark.trial
@pytest.mark.parametrize("scatter", [0.003, 0.0055])
def test_false_calls_are_no_more_than_stated(scatter: float) -> None:
    limit, hangers = 2.0, 50
    history = History((tension(0.006),), tests=20, days_between=30, scatter=scatter)
    options = WatchOptions(limit_years=limit)

    called, watched_years = 0, 0.0
    for seed in range(hangers):
        readings = history.readings(seed)
        calls = watch_of(readings, history.quantities, options).calls
        called += bool(calls)
        watched_years += years(readings, -1)

    stated = watched_years / limit / hangers
    assert called > 0
    assert called / hangers <= stated + 2 * math.sqrt(stated / hangers)


def test_five_quantities_without_change_are_left_alone_at_the_usual_limit() -> None:
    history = History(BOTH_ENDS, tests=12)

    assert not any(watch_of(history.readings(seed), BOTH_ENDS).calls for seed in range(3))
