"""The sequential watch of one hanger: a pass over its readings, a result after each."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import BadInput
from shm.values import (
    TENSION,
    Change,
    FloatArray,
    Hanger,
    Reading,
    WatchedQuantity,
    WatchedTest,
)
from shm.watch.options import WatchOptions
from shm.watch.sequential.bank import Bank, first_bank, read
from shm.watch.sequential.conclusions import Watcher, changed, drifted, probability_of_change
from shm.watch.sequential.measurement import measurements
from shm.watch.sequential.segments import taken_over

# All is measured from a baseline of one test: taken for a blunder, every loss after it would be the
# truth that it missed.
_OUTLIER_IF_ALONE = 1e-6


@dataclass(frozen=True, eq=False)
class Call:
    """A change that was called after the test at `index` of the watch; `change` as it was then."""

    index: int
    change: Change


@dataclass(frozen=True, eq=False)
class Watch:
    """The result after each reading, and the changes called on the way, in the order of time."""

    tests: tuple[WatchedTest, ...]
    calls: tuple[Call, ...]


def watched(
    readings: Sequence[Reading],
    quantities: tuple[WatchedQuantity, ...],
    hanger: Hanger,
    options: WatchOptions | None = None,
) -> tuple[WatchedTest, ...]:
    """What `watch_over` says after each reading."""
    return watch_over(readings, quantities, hanger, options).tests


def watch_over(
    readings: Sequence[Reading],
    quantities: tuple[WatchedQuantity, ...],
    hanger: Hanger,
    options: WatchOptions | None = None,
) -> Watch:
    """One result a reading, each of which rests on the readings up to it alone.

    Of each quantity the level is fixed, but for a linear effect of the temperature whose
    coefficient is learnt, and for changes: steps, or ramps that go on. A `change` is `called` at
    one test only; after it the watch looks for a further one, and drifts are the sum of all.
    Raises BadInput where readings are not in the order of time or not of these quantities.
    """
    options = options or WatchOptions()
    if not quantities:
        raise BadInput("The watch was given no quantity.", remedy="Watch the tension at least.")
    if not readings:
        return Watch((), ())
    watcher = Watcher(quantities, hanger, options, readings[0].time)
    bank = first_bank(*_priors(quantities, options), years=0.0)
    tests: list[WatchedTest] = []
    calls: list[Call] = []
    still_same = 1.0
    alone = replace(options, outlier_probability=_OUTLIER_IF_ALONE)
    for index, measurement in enumerate(measurements(readings, quantities, options)):
        is_baseline = index < options.baseline_tests
        believed = alone if is_baseline and options.baseline_tests == 1 else options
        bank = read(bank, measurement, believed, may_change=not is_baseline)
        tests.append(_result(watcher, bank, readings[index], 1 - still_same))
        if tests[-1].change.called:
            still_same *= 1 - probability_of_change(bank, options)
            calls.append(Call(index, tests[-1].change))
            bank = taken_over(bank)
    return Watch(tuple(tests), tuple(calls))


def _result(watcher: Watcher, bank: Bank, reading: Reading, before: float) -> WatchedTest:
    return WatchedTest(
        test=reading.test,
        time=reading.time,
        temperature_c=reading.temperature_c,
        drifts=drifted(watcher, bank, reading),
        change=changed(watcher, bank, reading, before),
    )


def _priors(
    quantities: Sequence[WatchedQuantity], options: WatchOptions
) -> tuple[FloatArray, FloatArray]:
    """Scatters (K, q) and sds of the temperature coefficients (q,) in units of a step."""
    tension = np.array([quantity.name == TENSION for quantity in quantities])
    steps = np.array([quantity.step_sd for quantity in quantities])
    of_springs = options.spring_scatter_of_step if not tension.all() else (0.0,)
    scatters = [
        np.where(tension, of_tension / steps, of_spring)
        for of_tension, of_spring in itertools.product(options.tension_scatter, of_springs)
    ]
    coefficients = np.where(
        tension, options.tension_per_kelvin_sd / steps, options.spring_per_kelvin_sd_of_step
    )
    return np.array(scatters), coefficients
