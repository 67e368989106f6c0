"""Report two tests that agree on a tension, whatever their clocks say and in whatever order.

The watch counts visits: a change has had time to come only between two, and only tests dated
before another speak for it there. So two tests next to each other, as they came in or as they are
dated, whose tensions are both beyond the threshold to one side are reported where the watch cannot
judge them: one is held or of planned works; the second is dated earlier; or both are dated as of
one visit and further off than by any load that stands on the deck for it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

import numpy as np

from shm.values import TENSION, Beside, Drift, Hanger, ModalTest, WatchedQuantity
from shm.values.drift import threshold_of
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import WatchOptions
from shm.watch.engine.posterior_summary import drift_of_normal
from shm.watch.engine.quantities import shift_of
from shm.watch.engine.readings import Reader

BY_A_LOAD = 0.1
"""Of the tension (judgement): a lift or a lorry that stands beside the hanger."""


_APART = timedelta(days=3)
"""Tests that far apart by their clocks are two visits."""

Way = Literal["up", "down"]


@dataclass(frozen=True)
class Shown:
    """A quantity by one test: coordinate and variance."""

    mean: float
    variance: float

    def agrees(self, other: Shown) -> bool:
        """Return True if two are on one side of the baseline, and within their errors."""
        apart = abs(self.mean - other.mean)
        within = LIMITS.agreement_clear * math.sqrt(self.variance + other.variance)
        return self.mean * other.mean > 0 and apart < within


@dataclass(frozen=True)
class Agreement:
    """Two `tests`, by name, that show the same `drift`; the first may be held."""

    drift: Drift
    tests: tuple[str, str]
    is_held: bool


def agreement(
    reader: Reader,
    newest: tuple[ModalTest, datetime],
    neighbours: Beside,
    hanger: Hanger,
    options: WatchOptions,
    announced: Collection[tuple[str, Way]],
) -> Agreement | None:
    """Return that a test is the second to show a tension beyond its threshold.

    None where it shows none, no test next to it agrees, the clocks say that it was a later visit,
    a test of a visit before shows the same, or the shift is `announced` already.
    """
    test, _ = newest
    tension = reader.quantities[0]
    threshold = threshold_of(TENSION, hanger)

    def show(test: ModalTest) -> Shown:
        return read_alone(reader, test, options)[0]

    def is_shown(shown: Shown) -> bool:
        is_clear = abs(shown.mean) >= LIMITS.agreement_clear * math.sqrt(shown.variance)
        return is_clear and abs(shift_of(tension, shown.mean)) >= threshold

    mine = show(test)
    if not is_shown(mine) or (TENSION, way_of(mine.mean)) in announced:
        return None
    unwatched = {*neighbours.held, *neighbours.of_works}
    earlier = {
        each.id: each
        for each in (*neighbours.came[0], *neighbours.dated[0])
        if _is_later(test, each) and each.id not in unwatched
    }
    if any(mine.agrees(show(each)) for each in earlier.values()):  # it is not new
        return None
    is_no_load = abs(shift_of(tension, mine.mean)) > BY_A_LOAD
    near = {tests[0].id: tests[0] for tests in (*neighbours.came, *neighbours.dated) if tests}
    for other in near.values():
        of_one_visit = is_no_load and not _is_later(test, other)
        if not (other.id in unwatched or _is_later(other, test) or of_one_visit):
            continue
        shown = show(other)
        if is_shown(shown) and mine.agrees(shown):
            drift = _drift(tension, newest, (mine, shown), hanger)
            return Agreement(drift, (other.id, test.id), other.id in neighbours.held)
    return None


def _is_later(one: ModalTest, other: ModalTest) -> bool:
    """Return True if one test was a later visit than the other, by their clocks."""
    return one.time is not None and other.time is not None and one.time - other.time >= _APART


def way_of(shift: float) -> Way:
    """Return to which side a shift goes."""
    return "down" if shift < 0 else "up"


def read_alone(reader: Reader, test: ModalTest, options: WatchOptions) -> list[Shown]:
    """Read each quantity with all that makes tests of an unchanged hanger differ.

    These are errors, scatter, and the temperature.
    """
    reading = reader.reading(test, datetime.max)
    pull = [1 / (LIMITS.pull_steps * each.step_sd) ** 2 for each in reader.quantities]
    covariance = np.linalg.inv(reading.information + np.diag(pull))
    kelvin = test.temperature_c - reader.reference_temperature_c
    if not math.isfinite(kelvin):
        kelvin = options.unknown_temperature_sd_k
    found = []
    for j, quantity in enumerate(reader.quantities):
        scatter, per_kelvin = options.tension_scatter, options.tension_per_kelvin_sd
        if quantity.name != TENSION:
            scatter = options.spring_scatter_of_step * quantity.step_sd
            per_kelvin = options.spring_per_kelvin_sd_of_step * quantity.step_sd
        of_both = (
            2 * (LIMITS.most_scatter * scatter) ** 2
        )  # a baseline of one test scatters as much
        variance = float(covariance[j, j]) + of_both + (per_kelvin * kelvin) ** 2
        found.append(Shown(float(reading.mean[j]), variance))
    return found


def drifts_of(
    reader: Reader, tests: Sequence[tuple[ModalTest, datetime]], hanger: Hanger
) -> tuple[Drift, ...]:
    """Return how far each quantity is off the baseline of `reader` by tests of one state alone."""
    options = WatchOptions.of(hanger.assumptions)
    read = [read_alone(reader, test, options) for test, _ in tests]
    return tuple(
        _drift(quantity, tests[-1], shown, hanger)
        for quantity, shown in zip(reader.quantities, zip(*read, strict=True), strict=True)
    )


def _drift(
    quantity: WatchedQuantity,
    newest: tuple[ModalTest, datetime],
    similar: Sequence[Shown],
    hanger: Hanger,
) -> Drift:
    """Return what tests that agree show, as if their errors were all of each alone: the larger."""
    weights = [1 / each.variance for each in similar]
    mean = float(np.average([each.mean for each in similar], weights=weights))
    sd = math.sqrt(max(each.variance for each in similar))
    return drift_of_normal(quantity, hanger, (newest[0].id, newest[1]), mean, sd)
