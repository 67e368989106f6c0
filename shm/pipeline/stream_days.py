"""Streams beside tests: days that become tests, the baseline, and which of them tells a change."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from shm.documents import dump
from shm.modes_document import modes_document
from shm.pipeline import Clock
from shm.pipeline.reconcile import SHM
from shm.read.atomic import replace_text
from shm.store import Store, Workspace
from shm.store.archive import MODES_SUFFIX
from shm.store.streams import find_first_window, find_pooled_range, list_window_starts
from shm.store.tests import list_test_rows
from shm.values import ModalTest, Posterior
from shm.values.stream import PERIOD, PERIODS, Stream, period_start

_LEARNING_DAYS = 7  # judgement: by then every class has been selected and the watch has learnt

_MAY_LACK = timedelta(hours=1)  # judgement: of a day, whose mean that hardly moves
_REST_COMES = timedelta(hours=6)
"""Judgement: a logger that sends what it stored sends on without so long a pause."""

log = logging.getLogger(__name__)


@dataclass
class RestOfDays:
    """Days whose rest may still come: a part of a day, as its night, is no test of it.

    A logger that was offline sends what it stored after what is new, or before it, in any order.
    `came` is when each stream last brought anything out of its turn, or was back after hours; what
    it brought before this process began is not known, and so counts as of its beginning. With
    `hurry` none is waited for.
    """

    clock: Clock
    hurry: bool = False
    came: dict[str, datetime] = field(default_factory=dict)
    lacking: dict[str, datetime] = field(default_factory=dict)

    def note(self, name: str, start: datetime, done: datetime) -> None:
        """A window has been read, of a stream that was done up to a time."""
        if not timedelta(0) <= start - done <= _REST_COMES:
            self.came[name] = self.clock()
            self.lacking.pop(name, None)

    def is_awaited(self, store: Store, name: str, day: datetime) -> bool:
        """Return True if a day that is over lacks windows that may still come."""
        end, now = day + PERIODS["day"], self.clock()
        if self.hurry or now >= max(self.came.setdefault(name, now), end) + _REST_COMES:
            return False
        if self.lacking.get(name) != day:
            begin = max(day, find_first_window(store, name) or day)
            found = sum(start < end for start in list_window_starts(store, name, begin))
            if end - begin - found * PERIOD <= _MAY_LACK:
                return False
            self.lacking[name] = day
        return True


def baseline_of(store: Store, stream: Stream) -> Posterior | None:
    """The baseline of the hanger, unless it is of the stream's own first days: another model
    would let the watch learn anew what it has half learnt.
    """
    found = store.watch.baseline(stream.hanger)
    if found is None:
        return None
    pooled = find_pooled_range(store, stream.name)
    if pooled is None:
        return found.posterior
    first = period_start(pooled[0], PERIODS["day"])
    days = (first + n * PERIODS["day"] for n in range(_LEARNING_DAYS))
    prefixes = tuple(f"{stream.name}-{day:%Y-%m-%d}" for day in days)
    is_of_stream = all(test.startswith(prefixes) for test in found.posterior.tests)
    return None if is_of_stream else found.posterior


def hand_on_day(workspace: Workspace, store: Store, test: ModalTest, at: datetime) -> None:
    """A day as a modal test into the spool, which takes the same bytes once.

    That of a day of which more came late takes the place of the former.
    """
    if test.hanger is None:
        return
    for row in list_test_rows(store, test.hanger):
        if not row.name.startswith(test.id):
            continue
        if _hz(store.tests.get(row.id).test) == _hz(test):
            return
        why = "more of this day came late: the whole day takes its place"
        store.recordings.exclude(row.recording_id, SHM, why, at)
    path = workspace.spool / f"{test.id}{MODES_SUFFIX}"
    replace_text(path, dump(modes_document([test])))
    log.info("day of a stream: %s", path.name)


def _hz(test: ModalTest) -> list[float]:
    return [mode.frequency_hz for mode in test.modes]
