"""Streams beside tests: days that become tests, the baseline, and which of them tells a change."""

from __future__ import annotations

import logging
from dataclasses import replace
from datetime import datetime

from shm.documents import dump
from shm.modes_document import modes_document
from shm.pipeline.ending import SHM, told_by_other
from shm.read.atomic import replace_text
from shm.store import Store, Workspace
from shm.store.archive import MODES_SUFFIX
from shm.values import Alert, ModalTest, Posterior
from shm.values.stream import PERIODS, Stream

_OWN_DAYS = 7  # judgement: by then every class has been selected and the watch has learnt

log = logging.getLogger(__name__)


def baseline_of(store: Store, stream: Stream) -> Posterior | None:
    """The baseline of the hanger, unless it is of the stream's own first days: another model
    would let the watch learn anew what it has half learnt.
    """
    found = store.watch.baseline(stream.hanger)
    if found is None:
        return None
    first = store.streams.first_day(stream.name)
    if first is None:
        return found.posterior
    days = (first + n * PERIODS["day"] for n in range(_OWN_DAYS))
    own = tuple(f"{stream.name}-{day:%Y-%m-%d}" for day in days)
    is_own = all(test.startswith(own) for test in found.posterior.tests)
    return None if is_own else found.posterior


def hand_on_day(workspace: Workspace, store: Store, test: ModalTest, at: datetime) -> None:
    """A day as a modal test into the spool, which takes the same bytes once.

    That of a day of which more came late takes the place of the former.
    """
    if test.hanger is None:
        return
    for row in store.tests.list_rows(test.hanger):
        if not row.name.startswith(test.id):
            continue
        if _hz(store.tests.get(row.id).test) == _hz(test):
            return
        why = "more of this day came late: the whole day takes its place"
        store.recordings.withdraw(row.recording_id, SHM, why, at)
    path = workspace.spool / f"{test.id}{MODES_SUFFIX}"
    replace_text(path, dump(modes_document([test])))
    log.info("day of a stream: %s", path.name)


def _hz(test: ModalTest) -> list[float]:
    return [mode.frequency_hz for mode in test.modes]


def is_told_already(store: Store, alert: Alert, *, of_stream: bool) -> bool:
    """Whether a hammer test, or a day as one, was first to tell it; where hours are gone over
    again, also whether they told it themselves before others of them came late (`of_stream`).
    """
    stored = store.alerts.list_all(alert.hanger)
    first = told_by_other(alert, stored, of_stream=False)
    if first is None and of_stream:
        kinds = set(alert.kinds)
        own = [replace(each, resolution=None) for each in stored if kinds <= set(each.alert.kinds)]
        first = told_by_other(alert, own, of_stream=True)
    if first is not None:
        log.info("alert %s is that of %s", alert.key, first.alert.key)
    return first is not None
