"""Tests of a structure without a model, one after another: pooled, watched, decided on.

A pool holds the tests of three days. It is looked at once it is complete, as the first test after
it shows; a test that comes after three days without any is looked at by itself at once, so that a
structure that is tested once a month waits for nothing. Tests between decide nothing yet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np

from shm.errors import BadInput
from shm.values import WITHOUT_MODEL, Alert, Hanger, ModalTest, Posterior, Reading, WatchedTest
from shm.watch.engine.frequencies import POOLED_DAYS, FrequencyReader
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.engine.options import WatchOptions
from shm.watch.engine.quantities import posterior_at
from shm.watch.state_sums import WatchState
from shm.watch.watcher import Watcher
from shm.watch.watching import AlertState, DatedTest, Newest, after, options_of, replay

_POOL = timedelta(days=POOLED_DAYS)


@dataclass(frozen=True, eq=False)
class _Pool:
    """Tests that are looked at together, the oldest first; `seen` are those that were looked at."""

    tests: tuple[DatedTest, ...] = ()
    seen: int = 0

    def takes(self, time: datetime) -> bool:
        return bool(self.tests) and time - self.tests[0][1] < _POOL


@dataclass(frozen=True, eq=False)
class _Watching:
    """A watch under way: what is known of the pools before, and the pool that grows."""

    state: WatchState
    told: AlertState
    pool: _Pool
    last: WatchedTest


class FrequencyWatch:
    """Watches one structure against its first tests, by time.

    Raises BadInput where these hold no mode.
    """

    def __init__(self, baseline: Sequence[DatedTest], hanger: Hanger, options: WatchOptions):
        self._hanger, self._pools = hanger, _pooled(baseline)
        self._reader = FrequencyReader([test for test, _ in baseline])
        self._since = max(time for _, time in baseline)
        self._watcher = Watcher(
            self._reader.quantities,
            self._reader.columns,
            hanger,
            options_of(hanger, len(self._pools), options),
        )
        self.key = self._watcher.key

    def begin(self) -> _Watching:
        """After the baseline."""
        state, watch = self._watcher.begin([self._reading(each) for each in self._pools])
        reported, _ = replay(watch.tests, self._hanger)
        return _Watching(state, reported, _Pool(), watch.tests[-1])

    def after(self, now: _Watching, dated: DatedTest) -> tuple[_Watching, Alert | None]:
        """After one more test, and the alert that it calls for.

        A test older than the baseline counts as made right after it. Raises BadInput where the test
        is older than another.
        """
        test, time = dated[0], max(dated[1], self._since)
        state, reported, pool, alert = now.state, now.told, now.pool, None
        if pool.tests and time < pool.tests[-1][1]:
            raise BadInput(
                f"The watch was given test {test.id} after one that is later.",
                remedy="Sort the tests by time.",
            )
        found = _between_looks(now.last)
        if pool.takes(time):
            pool = replace(pool, tests=(*pool.tests, (test, time)))
        else:
            is_dense = bool(pool.tests) and time - pool.tests[-1][1] < _POOL
            is_looked_at = len(pool.tests) == pool.seen
            if pool.tests:
                state, complete = self._watcher.after(state, self._reading(pool.tests))
                if not is_looked_at:
                    found = complete
                    reported, alert = after(reported, _as_of(found, test, time), self._hanger)
            pool = _Pool(((test, time),))
            if is_looked_at or not is_dense:
                with_it, found = self._watcher.after(state, self._reading(pool.tests))
                reported, later = after(reported, _as_of(found, test, time), self._hanger)
                pool, alert = replace(pool, seen=1), later or alert
                if found.change.called:  # once: the pool ends with the test that called it
                    state, pool = with_it, _Pool()
        return _Watching(state, reported, pool, _as_of(found, test, time)), alert

    def _reading(self, pool: Sequence[DatedTest]) -> Reading:
        return self._reader.reading([test for test, _ in pool], pool[-1][1])


def watch_newest_frequencies(
    baseline: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
    kept: bytes | None = None,
) -> Newest | None:
    """Return what `watch_newest` says of a hanger, of a structure without a model."""
    watch = FrequencyWatch(baseline, hanger, options)
    now = watch.begin() if kept is None else from_bytes(_Watching, kept)
    if now.state.key != watch.key:
        return None
    alert = None
    for dated in later:
        now, alert = watch.after(now, dated)
    return Newest(now.last, alert, to_bytes(now))


def measured_levels(tests: Sequence[ModalTest], seed: int) -> Posterior:
    """Return what stands for a posterior of a structure without a model.

    The median frequency (Hz) of each mode, as two equal draws. Nothing is sampled.
    """
    levels, structure = FrequencyReader(tests).levels_hz, Hanger.without_model(tests[0].hanger or 0)
    found = posterior_at(WITHOUT_MODEL, structure, levels)
    values, units = np.repeat(found.samples, 2, axis=0), ("Hz",) * len(levels)
    names, log_likelihood = tuple(test.id for test in tests), np.zeros(2)
    return replace(
        found, samples=values, log_likelihood=log_likelihood, units=units, tests=names, seed=seed
    )


@dataclass(frozen=True, eq=False)
class WatchedFrequencies:
    """Results of the watch after each test since the baseline's, and the alerts it calls for."""

    tests: tuple[WatchedTest, ...]
    alerts: tuple[Alert, ...]


def watch_frequencies(
    tests: Sequence[ModalTest],
    *,
    baseline_tests: int = 30,
    name: str = "",
    options: WatchOptions | None = None,
) -> WatchedFrequencies:
    """The watch of a structure without a model, over tests that each have a time, in any order.

    The first `baseline_tests` are taken to precede every change; of daily tests 30 are ten pools.
    `name` is what alerts call it. Raises BadInput where a test has no time, or too few are given.

    Example:
        >>> found = watch_frequencies(load_modes("deck.modes.json"), name="Deck")
        >>> [alert.message for alert in found.alerts]
        ['The frequencies of Deck have dropped by 2.0 ± 0.2 % since 2028-04-02. ...']
    """
    dated = []
    for test in tests:
        if test.time is None:
            raise BadInput(f"Test {test.id} has no time.", remedy="Give each test its time.")
        dated.append((test, test.time))
    dated.sort(key=lambda each: each[1])
    if not 0 < baseline_tests <= len(dated):
        raise BadInput(
            f"{len(dated)} tests are fewer than the baseline's {baseline_tests}.",
            remedy="Give more tests, or a smaller baseline_tests.",
        )
    hanger = Hanger.without_model(tests[0].hanger or 0, name)
    watch = FrequencyWatch(
        dated[:baseline_tests], hanger, options or WatchOptions.of(hanger.assumptions)
    )
    now, found, alerts = watch.begin(), [], []
    for each in dated[baseline_tests:]:
        now, alert = watch.after(now, each)
        found.append(now.last)
        alerts += [alert] if alert else []
    return WatchedFrequencies(tuple(found), tuple(alerts))


def _pooled(tests: Sequence[DatedTest]) -> list[tuple[DatedTest, ...]]:
    pools = [_Pool()]
    for each in tests:
        if pools[-1].takes(each[1]):
            pools[-1] = replace(pools[-1], tests=(*pools[-1].tests, each))
        else:
            pools.append(_Pool((each,)))
    return [pool.tests for pool in pools[1:]]


def _between_looks(found: WatchedTest) -> WatchedTest:
    """Return the same at a test that decides nothing: a change that was called is called once."""
    if not found.change.called:
        return found
    return replace(found, change=replace(found.change, evidence_years=0.0))


def _as_of(found: WatchedTest, test: ModalTest, time: datetime) -> WatchedTest:
    """Return what the pools say, as it is known at a test."""
    drifts = tuple(replace(each, test=test.id, time=time) for each in found.drifts)
    return replace(found, test=test.id, time=time, temperature_c=test.temperature_c, drifts=drifts)
