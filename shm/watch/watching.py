"""The watch of one hanger as a whole: tests read, put through the sequential test, decided on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from shm.values import Alert, Hanger, ModalTest, Posterior, Reading, WatchedTest
from shm.watch.deciding import after, new_alert
from shm.watch.options import WatchOptions
from shm.watch.readings import Reader
from shm.watch.sequential import Watch, Watcher, WatchState, watch_over
from shm.watch.told import Told

DatedTest = tuple[ModalTest, datetime]
"""A test, and its own time or that of its receipt."""


@dataclass(frozen=True, eq=False)
class Watched:
    """All tests of a hanger since its baseline, the oldest first, and what the watch made of them.

    `watch` has a result for each of `readings`; the first of these are the baseline's.
    """

    reader: Reader
    readings: tuple[Reading, ...]
    watch: Watch

    @property
    def latest(self) -> WatchedTest:
        return self.watch.tests[-1]

    def alert(self, hanger: Hanger) -> Alert | None:
        """What the newest test calls for, beyond what was told before."""
        return new_alert(self.watch.tests, hanger)


def watch_hanger(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
) -> Watched:
    """The watch of a hanger over the tests of its baseline and `later` ones, both by time.

    How many tests precede every change follows from `baseline_tests`, whatever `options` say; how
    often it may be called falsely from the hanger's `false_call_years`, where it has its own.
    A test that is older than the baseline's counts as made right after them: all later ones are
    compared with the baseline. Raises BadInput where the baseline's tests hold no mode that its
    class describes.
    """
    reader = Reader(baseline, [test for test, _ in baseline_tests], hanger)
    since = max(time for _, time in baseline_tests)
    dated = [*baseline_tests, *((test, max(time, since)) for test, time in later)]
    readings = tuple(reader.reading(test, time) for test, time in dated)
    options = _options_of(hanger, len(baseline_tests), options)
    return Watched(reader, readings, watch_over(readings, reader.quantities, hanger, options))


@dataclass(frozen=True, eq=False)
class Newest:
    """What the watch says after the newest test, the alert it calls for, and what to keep."""

    test: WatchedTest
    alert: Alert | None
    kept: bytes


def watch_newest(
    baseline: Posterior,
    baseline_tests: Sequence[DatedTest],
    later: Sequence[DatedTest],
    hanger: Hanger,
    options: WatchOptions,
    kept: bytes | None = None,
) -> Newest | None:
    """The last of what `watch_hanger` finds, from what was `kept` after the tests before it.

    `later` are then the tests since, the newest alone as a rule; without `kept` all of them. None
    where nothing can go on from what was kept, since rules, options or description have changed:
    then the watch must begin without it.
    """
    reader = Reader(baseline, [test for test, _ in baseline_tests], hanger)
    options = _options_of(hanger, len(baseline_tests), options)
    watcher = Watcher(reader.quantities, hanger, options)
    if kept is None:
        readings = [reader.reading(test, time) for test, time in baseline_tests]
        state, watch = watcher.begin(readings)
        told, alert = Told(), None
        for found in watch.tests:
            told, alert = after(told, found, hanger)
    else:
        state = WatchState.from_bytes(kept)
        if state.key != watcher.key:
            return None
        told = Told.from_text(state.told)
    since = max(time for _, time in baseline_tests)
    for test, time in later:
        state, found = watcher.after(state, reader.reading(test, max(time, since)))
        told, alert = after(told, found, hanger)
    return Newest(found, alert, replace(state, told=told.to_text()).to_bytes())


def _options_of(hanger: Hanger, baseline_tests: int, options: WatchOptions) -> WatchOptions:
    """How many tests precede every change, and how often this hanger may be called falsely."""
    own = hanger.thresholds.false_call_years
    limit_years = options.limit_years if own is None else own
    return replace(options, baseline_tests=baseline_tests, limit_years=limit_years)
