"""Two tests that agree, whatever their clocks say and in whatever order they came.

The watch counts visits: a change has had time to come only between two, and only tests dated
before another speak for it there. A clock that hardly moves, or files that come in another order,
would take the evidence away. So two tests next to each other, as they came in or as they are dated,
that each read beyond the threshold to one side are told by themselves where one is none that the
watch has counted, being held or of planned works; where the second is dated earlier; and where both
are dated as of one visit, if they are further off than by any load that stands on the deck for it.
Tests of two visits are the watch's to judge: it knows how often those of this hanger do so without
a change.

One blunder in a hundred tests (`WatchOptions.outlier_probability`) makes two in a row once in ten
thousand, and few of these read beyond a threshold, to one side and alike.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

import numpy as np

from shm.values import TENSION, Alert, Beside, Drift, Hanger, ModalTest, WatchedQuantity
from shm.values.drift import threshold_of
from shm.watch.alert_text import alert_of, message_of_agreeing
from shm.watch.options import WatchOptions
from shm.watch.persistence import LARGE
from shm.watch.posterior_summary import drift_of_normal
from shm.watch.quantities import shift_of
from shm.watch.readings import Reader

CLEAR = 3.0
"""Standard deviations from the baseline, temperature and scatter included: one good test in 740
lies that far to one side, fewer than are blunders."""

BY_A_LOAD = 0.1
"""Of the tension (judgement): a lift or a lorry that stands beside the hanger."""

_PULL_STEPS = 10.0
"""Standard deviation, in steps, of what a test does not see: far beyond any threshold."""

_MOST_SCATTER = 2.0
"""Of what a test scatters by beyond its errors: the most that is usual over what is assumed."""

_APART = timedelta(days=3)
"""Tests that far apart by their clocks are two visits."""

_LEAST = 0.01
"""Of a frequency, in the mean: decades of an end that is as good as clamped move nothing."""

Way = Literal["up", "down"]


@dataclass(frozen=True)
class Shown:
    """A quantity by one test: coordinate, variance, and its effect on the mean log frequency."""

    mean: float
    variance: float
    moves: float


def agreement(
    reader: Reader,
    newest: tuple[ModalTest, datetime],
    beside: Beside,
    hanger: Hanger,
    options: WatchOptions,
    told: Collection[tuple[str, Way]],
) -> Alert | None:
    """Return the alert of a test that is the second to show a shift beyond its threshold.

    None where it shows none, no test next to it agrees, the clocks say that it was a later visit,
    or the shift is `told` already.
    """
    its = _shown(reader, newest[0], hanger, options)
    if not any(its):
        return None
    near = {tests[0].id: tests[0] for tests in (*beside.came, *beside.dated) if tests}
    others = [(test, _shown(reader, test, hanger, options)) for test in near.values()]
    for j, (quantity, mine) in enumerate(zip(reader.quantities, its, strict=True)):
        if mine is None or (quantity.name, way_of(mine.mean)) in told:
            continue
        for other, shown in others:
            same = shown[j]
            if same and _agree(mine, same) and _is_unwatched(quantity, mine, newest, other, beside):
                drift = _drift(quantity, newest, (mine, same), hanger)
                what = f"two-tests-agree:{drift.quantity}-{way_of(drift.shift_mean)}"
                is_held = other.id in beside.held
                words = message_of_agreeing(
                    drift, hanger, (other.id, newest[0].id), is_held=is_held
                )
                of_test = (newest[0].id, newest[1])
                return alert_of(hanger, of_test, what, words, ("beyond threshold",), (drift,))
    return None


def _is_unwatched(
    quantity: WatchedQuantity,
    shown: Shown,
    newest: tuple[ModalTest, datetime],
    other: ModalTest,
    beside: Beside,
) -> bool:
    """Return True if the watch cannot judge two tests as two visits.

    It has not counted the other one, or that is dated later; of one visit they must be further off
    than by any load.
    """
    if other.id in {*beside.held, *beside.of_works} or _is_later(other, newest[0]):
        return True
    return _is_no_load(quantity, shown) and not _is_later(newest[0], other)


def _is_no_load(quantity: WatchedQuantity, shown: Shown) -> bool:
    """Return True if a quantity is further off than by any load that stands on the deck."""
    if quantity.name == TENSION:
        return bool(abs(shift_of(quantity, shown.mean)) > BY_A_LOAD)
    return shown.moves > LARGE


def _is_later(one: ModalTest, other: ModalTest) -> bool:
    """Return True if one test was a later visit than the other, by their clocks."""
    return one.time is not None and other.time is not None and one.time - other.time >= _APART


def way_of(shift: float) -> Way:
    """To which side a shift goes."""
    return "down" if shift < 0 else "up"


def _agree(one: Shown, other: Shown) -> bool:
    apart = abs(one.mean - other.mean)
    return one.mean * other.mean > 0 and apart < CLEAR * math.sqrt(one.variance + other.variance)


def _shown(
    reader: Reader, test: ModalTest, hanger: Hanger, options: WatchOptions
) -> list[Shown | None]:
    """Return each quantity by a test; None where it is not clear, or below its threshold."""
    found: list[Shown | None] = []
    for quantity, each in zip(reader.quantities, read_alone(reader, test, options), strict=True):
        is_beyond = abs(shift_of(quantity, each.mean)) >= threshold_of(quantity.name, hanger)
        is_clear = abs(each.mean) >= CLEAR * math.sqrt(each.variance)
        is_felt = each.moves >= _LEAST
        found.append(each if is_beyond and is_clear and is_felt else None)
    return found


def read_alone(reader: Reader, test: ModalTest, options: WatchOptions) -> list[Shown]:
    """With all that makes tests of an unchanged hanger differ: errors, scatter, temperature."""
    reading = reader.reading(test, datetime.max)
    pull = [1 / (_PULL_STEPS * each.step_sd) ** 2 for each in reader.quantities]
    covariance = np.linalg.inv(reading.information + np.diag(pull))
    kelvin = test.temperature_c - reader.reference_temperature_c
    if not math.isfinite(kelvin):
        kelvin = options.unknown_temperature_sd_k
    found = []
    slopes = np.zeros(len(reader.quantities))
    if reading.modes is not None:
        slopes = reading.modes.slopes[np.isfinite(reading.modes.variances)].mean(axis=0)
    for j, quantity in enumerate(reader.quantities):
        scatter = _MOST_SCATTER * _scatter_of(quantity, options)
        per_kelvin = (
            options.tension_per_kelvin_sd
            if quantity.name == TENSION
            else options.spring_per_kelvin_sd_of_step * quantity.step_sd
        )
        of_both = 2 * scatter**2  # a baseline of one test scatters as much
        variance = float(covariance[j, j]) + of_both + (per_kelvin * kelvin) ** 2
        mean = float(reading.mean[j])
        found.append(Shown(mean, variance, abs(mean * float(slopes[j]))))
    return found


def _scatter_of(quantity: WatchedQuantity, options: WatchOptions) -> float:
    """Return what a test of an unchanged hanger scatters by, in the coordinate."""
    if quantity.name == TENSION:
        return options.tension_scatter
    return options.spring_scatter_of_step * quantity.step_sd


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
    alike: Sequence[Shown],
    hanger: Hanger,
) -> Drift:
    """Return what tests that agree show, as if their errors were all of each alone: the larger."""
    weights = [1 / each.variance for each in alike]
    mean = float(np.average([each.mean for each in alike], weights=weights))
    sd = math.sqrt(max(each.variance for each in alike))
    return drift_of_normal(quantity, hanger, (newest[0].id, newest[1]), mean, sd)
