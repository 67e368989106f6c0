"""The sequential watch of one hanger: a result after each reading, from the state before it.

What goes on after a call: the called change is part of the state, and the next is looked for.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property

import numpy as np

from shm.errors import BadInput, UsageError
from shm.values import (
    TENSION,
    BoolArray,
    Change,
    FloatArray,
    Hanger,
    IntArray,
    Reading,
    WatchedQuantity,
    WatchedTest,
)
from shm.watch.options import WatchOptions
from shm.watch.sequential.bank import KINDS, RAMP, Bank, first_bank, read
from shm.watch.sequential.design import Design, Warmth, directions_of, measurement_of, years_between
from shm.watch.sequential.filtering import Filters
from shm.watch.sequential.posterior_summary import Subject, changed, drifted, probability_of_change
from shm.watch.sequential.state import WatchState

# To be raised whenever the same readings give other results than before: kept states are void then.
_VERSION = 2
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


@dataclass(frozen=True, eq=False)
class Watcher:
    """Watches one hanger, test by test: `begin` with its baseline, `after` for each one later.

    Of each quantity the level is fixed, but for a linear effect of the temperature whose
    coefficient is learnt, and for changes: steps, or ramps that go on. A `change` is `called` at
    one test only; after it the watch looks for a further one, and drifts are the sum of all.
    Raises BadInput without any quantity.
    """

    quantities: tuple[WatchedQuantity, ...]
    hanger: Hanger
    options: WatchOptions = field(default_factory=WatchOptions)

    def __post_init__(self) -> None:
        if not self.quantities:
            raise BadInput("The watch was given no quantity.", remedy="Watch the tension at least.")

    @cached_property
    def key(self) -> str:
        """Names what a state rests on beside the readings: the rules, options and quantities."""
        given = [_VERSION, asdict(self.options), [_told(each) for each in self.quantities]]
        return hashlib.sha256(json.dumps(given).encode()).hexdigest()

    def begin(self, readings: Sequence[Reading]) -> tuple[WatchState, Watch]:
        """The state after the readings of the baseline, by time, and a result for each of them.

        Raises UsageError where these are more than the options' `baseline_tests`, or none. Where
        they are fewer, the state cannot go on.
        """
        if not 0 < len(readings) <= self.options.baseline_tests:
            raise UsageError(
                f"The watch was to begin with {len(readings)} readings; its baseline has "
                f"{self.options.baseline_tests}."
            )
        time = readings[0].time
        bank = first_bank(directions_of(self.quantities), *_priors(self.quantities, self.options))
        warmth = Warmth.at([reading.temperature_c for reading in readings])
        state, tests = WatchState(self.key, 0, time, time, bank, warmth, 1.0), []
        for reading in readings:
            state, found = self._next(state, reading)
            tests.append(found)
        return state, Watch(tuple(tests), ())

    def after(self, state: WatchState, reading: Reading) -> tuple[WatchState, WatchedTest]:
        """The state after one more reading, and the result.

        Raises BadInput where the reading is older than the last, or of other quantities, UsageError
        where the state is that of another watch, or its baseline is not complete.
        """
        if state.key != self.key or state.tests < self.options.baseline_tests:
            raise UsageError(
                "This state of a watch is not of this hanger, baseline and options.",
                remedy="Begin the watch anew.",
            )
        return self._next(state, reading)

    def _next(self, state: WatchState, reading: Reading) -> tuple[WatchState, WatchedTest]:
        if reading.time < state.last_time:
            raise BadInput(
                f"The watch was given test {reading.test} after one that is later.",
                remedy="Sort the tests by time.",
            )
        years = years_between(state.start, reading.time)
        warmth, *kelvin = state.warmth.after(reading.temperature_c, years, self.options)
        steps = np.array([quantity.step_sd for quantity in self.quantities])
        measurement = measurement_of(reading, steps, years, *kelvin)
        is_baseline = state.tests < self.options.baseline_tests
        bank = read(state.bank, measurement, self._believed(state), may_change=not is_baseline)
        subject = Subject(self.quantities, self.hanger, self.options, state.start)
        found = _result(subject, bank, reading, 1 - state.still_same)
        still_same = state.still_same
        if found.change.called:
            still_same *= 1 - probability_of_change(bank, self.options)
            bank = taken_over(bank)
        later = replace(
            state,
            tests=state.tests + 1,
            last_time=reading.time,
            bank=bank,
            warmth=warmth,
            still_same=still_same,
        )
        return later, found

    def _believed(self, state: WatchState) -> WatchOptions:
        alone = self.options.baseline_tests == 1 and not state.tests
        return (
            replace(self.options, outlier_probability=_OUTLIER_IF_ALONE) if alone else self.options
        )


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

    The same as a Watcher finds test by test. Raises BadInput where readings are not in the order of
    time or not of these quantities.
    """
    watcher = Watcher(quantities, hanger, options or WatchOptions())
    if not readings:
        return Watch((), ())
    count = watcher.options.baseline_tests
    state, begun = watcher.begin(readings[:count])
    tests = list(begun.tests)
    for reading in readings[count:]:
        state, found = watcher.after(state, reading)
        tests.append(found)
    calls = (Call(n, test.change) for n, test in enumerate(tests) if test.change.called)
    return Watch(tuple(tests), tuple(calls))


def _told(quantity: WatchedQuantity) -> list[object]:
    """All of a quantity, its table as a digest."""
    table = np.array([quantity.coordinates, quantity.values]).tobytes()
    plain = (getattr(quantity, name) for name in ("name", "baseline", "step_sd", "end", "plane"))
    return [*plain, *quantity.parameters, hashlib.sha256(table).hexdigest()]


def _result(subject: Subject, bank: Bank, reading: Reading, before: float) -> WatchedTest:
    return WatchedTest(
        test=reading.test,
        time=reading.time,
        temperature_c=reading.temperature_c,
        drifts=drifted(subject, bank, reading),
        change=changed(subject, bank, reading, before),
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


# Technical: the share of a change from which the state has a place for its jump, or its rate.
_PLACE_FOR_A_JUMP = 1e-4
_PLACE_FOR_A_RATE = 1e-2


def taken_over(bank: Bank) -> Bank:
    """The bank once its change is called: no further change, for each scatter.

    All changes that may have been the called one are merged by their moments. Jump and level stay
    apart in the state, so that later tests still sharpen both, and which quantity it was.
    """
    share = bank.shares
    design = _design(bank, share)
    rows = bank.scatters + np.arange(share.size).reshape(share.shape)
    states = [
        _merged(bank, design, rows[:, k].ravel(), share[:, k].ravel()) for k in range(bank.scatters)
    ]
    filters = Filters(
        np.array([mean for mean, _ in states]),
        np.array([covariance for _, covariance in states]),
        bank.filters.scatter[: bank.scatters],
    )
    log_mass = np.log(np.maximum(share.sum(axis=(0, 2, 3)), 1e-300))
    return replace(
        bank,
        design=design,
        filters=filters,
        log_mass=log_mass,
        called=1 - (1 - bank.called) * (1 - share.sum(axis=(0, 1, 2)) @ bank.members),
        beginnings=(),
        outlier=np.zeros(0),
    )


def _design(bank: Bank, share: FloatArray) -> Design:
    """With a place for each quantity that may have changed, and for what may be going on."""
    jumped = _members(bank, share.sum(axis=(0, 1, 2)) > _PLACE_FOR_A_JUMP)
    going_on = _members(bank, share[:, :, RAMP].sum(axis=(0, 1)) > _PLACE_FOR_A_RATE)
    return bank.design.after(bank.years, jumped, going_on)


def _members(bank: Bank, chosen: BoolArray) -> set[int]:
    """The quantities that move in the directions `chosen` (D,)."""
    pairs = zip(bank.directions, chosen.tolist(), strict=True)
    return {j for direction, taken in pairs if taken for j in direction.members}


def _merged(
    bank: Bank, design: Design, rows: IntArray, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (n,) and covariance (n, n) of one scatter's changes in the later design."""
    kept = share > 1e-6 * share.max()
    rows, weights = rows[kept], share[kept] / share[kept].sum()
    progress = bank.progress
    means, covariances = [], []
    for row in rows:
        kind = (row - bank.scatters) // len(bank.directions) % KINDS
        carry = bank.design.carried(design, float(progress[row]), kind == RAMP)
        means.append(carry @ bank.filters.mean[row])
        covariances.append(carry @ bank.filters.covariance[row] @ carry.T)
    mean = weights @ np.array(means)
    apart = np.array(means) - mean
    within = np.einsum("b,bij->ij", weights, np.array(covariances))
    return mean, within + np.einsum("b,bi,bj->ij", weights, apart, apart)
