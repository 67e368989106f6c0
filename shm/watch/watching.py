"""The watch of one hanger as a whole: tests read, put through the sequential test, decided on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from shm.values import Alert, Hanger, ModalTest, Posterior, Reading, WatchedTest
from shm.watch.deciding import new_alert
from shm.watch.options import WatchOptions
from shm.watch.readings import Reader
from shm.watch.sequential import Watch, watch_over

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

    How many tests precede every change follows from `baseline_tests`, whatever `options` say.
    A test that is older than the baseline's counts as made right after them: all later ones are
    compared with the baseline. Raises BadInput where the baseline's tests hold no mode that its
    class describes.
    """
    reader = Reader(baseline, [test for test, _ in baseline_tests], hanger)
    since = max(time for _, time in baseline_tests)
    dated = [*baseline_tests, *((test, max(time, since)) for test, time in later)]
    readings = tuple(reader.reading(test, time) for test, time in dated)
    options = replace(options, baseline_tests=len(baseline_tests))
    return Watched(reader, readings, watch_over(readings, reader.quantities, hanger, options))
