"""One hanger through its years, watched by every rule."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from shm.inference import UpdateOptions, update
from shm.models import build
from shm.values import TENSION, ModalTest, Reading, WatchedQuantity, WatchedTest
from shm.watch.options import WatchOptions
from shm.watch.readings import Reader
from shm.watch.watcher import watched
from tests.benchmarks.drift.climate import days_since
from tests.benchmarks.drift.outcomes import BEYOND, OURS, Outcome
from tests.benchmarks.drift.rivals import statistics
from tests.benchmarks.drift.scenarios import Scenario
from tests.benchmarks.drift.years import SimulatedHanger, Years, simulated_hanger, years_of

_MODEL, _SAMPLES = "beam2", 200
_NEVER_YEARS = 1e300
_FIGURES = 4


@dataclass(frozen=True)
class Task:
    """A hanger by its seed, through some scenarios; the baseline rests on its first tests."""

    seed: int
    scenarios: tuple[Scenario, ...]
    years: float
    baseline_tests: int


def solved(task: Task) -> list[Outcome]:
    """All scenarios of a hanger; they share its baseline, for nothing has changed by then."""
    simulated = simulated_hanger(task.seed)
    desks: dict[float, _Desk] = {}
    found = []
    for scenario in task.scenarios:
        made = years_of(simulated, scenario, task.years)
        if scenario.season_k not in desks:
            desks[scenario.season_k] = _Desk(simulated, made, task.baseline_tests)
        found.append(_outcome(simulated, scenario, made, desks[scenario.season_k]))
    return found


class _Desk:
    """Reads the tests of one season's scenarios; those before a change are read once.

    The baseline is the posterior of the first tests jointly, by the usual sampler.
    """

    def __init__(self, simulated: SimulatedHanger, made: Years, baseline_tests: int):
        tests = made.tests[:baseline_tests]
        options = UpdateOptions(samples=_SAMPLES, seed=simulated.seed)
        posterior = update(tests, build(_MODEL, simulated.hanger), options)
        self.reader = Reader(posterior, tests, simulated.hanger)
        self.baseline_tests = baseline_tests
        self._known: dict[tuple[str, tuple[float, ...]], Reading] = {}

    def reading(self, test: ModalTest) -> Reading:
        key = test.id, tuple(mode.frequency_hz for mode in test.modes)
        if key not in self._known:
            assert test.time is not None
            self._known[key] = self.reader.reading(test, test.time)
        return self._known[key]


def _outcome(simulated: SimulatedHanger, scenario: Scenario, made: Years, desk: _Desk) -> Outcome:
    readings = [desk.reading(test) for test in made.tests]
    quantities = desk.reader.quantities
    # A limit beyond reach keeps the evidence one statistic that any limit can be put to later.
    options = WatchOptions(limit_years=_NEVER_YEARS, baseline_tests=desk.baseline_tests)
    started = time.process_time()
    told = watched(readings, quantities, desk.reader.columns, simulated.hanger, options).tests
    seconds = time.process_time() - started
    days = np.array([days_since(reading.time) for reading in readings])
    after = np.flatnonzero(days > simulated.began_day)
    return Outcome(
        seed=simulated.seed,
        scenario=scenario.name,
        days=tuple(float(each) for each in days.round(3)),
        changed_at=int(after[0]) if scenario.changes and len(after) else None,
        statistics={
            OURS: _rounded([each.change.evidence_years for each in told]),
            BEYOND: _rounded([_beyond(each) for each in told]),
            **{rule: _rounded(each) for rule, each in statistics(readings, days).items()},
        },
        named=tuple(_named(each) for each in told),
        truth=_truth(simulated, scenario, quantities),
        plane_of={each.name: each.plane for each in quantities},
        seconds=seconds,
    )


def _rounded(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_FIGURES}g}") for value in values)


def _beyond(told: WatchedTest) -> float:
    """The largest probability of any shift beyond its threshold."""
    return max(drift.probability for drift in told.drifts)


def _named(told: WatchedTest) -> tuple[str, ...]:
    """What moved likeliest, what moved with it and what is alike; nothing within the baseline."""
    if not told.change.moved:
        return ()
    first = told.change.moved[0]
    return first.quantity, *first.together, *first.alike


def _truth(
    simulated: SimulatedHanger, scenario: Scenario, quantities: Sequence[WatchedQuantity]
) -> tuple[str, ...]:
    """The quantities that changed, by the watch's names."""
    if not scenario.changes:
        return ()
    if scenario.kind == "tension":
        return (TENSION,)
    planes = ("transverse", "longitudinal")
    given = planes if scenario.kind == "both planes" else (simulated.plane,)
    return tuple(
        each.name
        for each in quantities
        if each.name != TENSION
        and each.plane in (None, *given)
        and each.end in (None, simulated.end)
    )
