"""The rate of false calls that the manual states: the statistic's mean is at most the time.

Causes other than tension and ends hold a third of the prior. Their changes are large, so that their
part of the mean rests on rare large values: hardly any run of this size shows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from _pytest.mark import ParameterSet

from shm.values import FloatArray, Reading
from shm.watch.engine.options import WatchOptions
from tests.helpers.synthetic_readings import START, History, tension, watch_of

WEAK_STEP = 0.001
"""A change much below the scatter: then the statistic's mean is not that of a few large values."""
LIMIT_YEARS = 2.0


def few_and_many(values: Sequence[float], few: int, many: int) -> list[ParameterSet]:
    """Return a quick case of the first value, slow ones of the others, and a trial of each."""
    quick = [pytest.param(value, few, id=f"{value}-few") for value in values[:1]]
    slow = [
        pytest.param(value, few, id=f"{value}-few", marks=pytest.mark.slow) for value in values[1:]
    ]
    trials = [
        pytest.param(value, many, id=f"{value}-many", marks=pytest.mark.trial) for value in values
    ]
    return quick + slow + trials


def years(readings: list[Reading], index: int) -> float:
    return (readings[index].time - START).total_seconds() / 86400 / 365.25


def measure_statistics(beginnings: int, hangers: int) -> FloatArray:
    """Return years watched and the statistic (n, 2) of hangers without change, never called."""
    history = History((tension(WEAK_STEP),), tests=16, days_between=30, scatter=0.003, outliers=0)
    options = WatchOptions(
        limit_years=math.inf,
        tension_scatter=0.003,
        spring_scatter_of_step=0.06,
        scatter_scales=(1.0,),
        beginnings=beginnings,
    )
    found = []
    for seed in range(hangers):
        readings = history.readings(seed)
        result = watch_of(readings, history.quantities, options).tests[-1].change
        # The last test alone speaks for no change: its time is not counted.
        found.append((years(readings, -2) - years(readings, 0), result.evidence_years))
    return np.array(found)


def count_calls(scatter: float, hangers: int, step: float = 0.0) -> tuple[int, float]:
    """Return how many hangers were called, and how many calls the limit allows for their time."""
    history = History(
        (tension(0.006),),
        tests=20,
        days_between=30,
        scatter=scatter,
        change_at=10 if step else 10**6,
        step=[step],
    )
    called, watched_years = 0, 0.0
    for seed in range(hangers):
        readings = history.readings(seed)
        calls = watch_of(readings, history.quantities, WatchOptions(limit_years=LIMIT_YEARS)).calls
        called += bool(calls)
        watched_years += years(readings, -1)
    return called, watched_years / LIMIT_YEARS


@pytest.mark.parametrize(("beginnings", "hangers"), few_and_many((40, 8), 8, 100))
def test_evidence_years_without_change(beginnings: int, hangers: int) -> None:
    """It grows by 0.75 of the time watched: by the prior of tension and ends, 0.68, and a little
    of the others'."""
    time, statistic = measure_statistics(beginnings, hangers).T
    error = np.std(statistic - time) / math.sqrt(hangers) / time.mean()
    assert error < 0.05
    assert 0.68 - 3 * error < statistic.mean() / time.mean() < 0.85 + 3 * error


@pytest.mark.parametrize(("scatter", "hangers"), few_and_many((0.0055, 0.003), 6, 50))
def test_false_calls_below_limit(scatter: float, hangers: int) -> None:
    """Far fewer than the limit allows are called, and nearly all that lost a twelfth."""
    called, allowed = count_calls(scatter, hangers)
    assert called <= 0.2 * allowed
    assert count_calls(scatter, 3, math.log(1 - 1 / 12))[0] >= 2
