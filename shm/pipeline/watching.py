"""Choose the tests that the watch goes over or judges again; reconcile the alerts.

A threshold judges the stored tests too: at once they are compared with their baseline again. A loss
that only the new one calls is raised; an alert that no test is beyond any more is closed, and says
why. What was told before is not told again.

Nothing here imports what computes, so that the daemon itself begins quickly and stays small.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from math import isnan
from typing import TYPE_CHECKING

import shm
from shm.errors import NothingThere
from shm.pipeline.conditions import Evidence, conditions_of, is_gap_larger
from shm.pipeline.reconcile import reconcile
from shm.settings import Settings
from shm.store import (
    Baseline,
    Reconciled,
    Stage,
    Store,
    StoredAlert,
    StoredTest,
    TestRow,
    Workspace,
)
from shm.store.recordings import list_holds
from shm.store.rows import StoredWatch
from shm.store.tests import (
    find_watch_state,
    is_caught_up,
    is_watched_again,
    list_baseline_tests,
    list_nearest_tests,
    list_watched_tests,
)
from shm.store.watch import find_latest_watches
from shm.values import Alert, Beside, Hanger, ModalTest, WatchedTest
from shm.values.drift import threshold_of

if TYPE_CHECKING:
    from shm.watch import DatedTest


_N_NEIGHBOURS = 2  # of which two that agree have been told before


@dataclass(frozen=True)
class ToWatch:
    """Input of a watch: the tests of the baseline and those to go over, the newest last.

    With a `state` the newest goes alone. `key` tells the state stored after it from that
    stored after other tests, or by another shm.
    """

    baseline_tests: Sequence[DatedTest]
    later: Sequence[DatedTest]
    state: bytes | None
    key: str


def to_watch(store: Store, baseline: Baseline, newest: StoredTest) -> ToWatch:
    """Return what the watch of a test needs.

    How many tests there were before costs next to nothing.
    """
    before, state = list_watched_tests(store, baseline, newest), find_watch_state(store, baseline)
    key = _key(before, newest)
    if state is None or state.key != _key(before):
        return ToWatch(*dated_tests(store, baseline, newest), None, key)
    return ToWatch(
        _dated(list_baseline_tests(store, baseline)), _dated([newest]), state.content, key
    )


def find_neighbouring_tests(store: Store, baseline: Baseline, newest: StoredTest) -> Beside:
    """The tests that a test may agree with: two each way, as they came in and by their clocks.

    What is held for its clock alone came in as any other: what it measured is in no doubt. Tests
    that were passed over for planned works count here alone: a loss that lasts agrees with them.
    """
    by_clock = [
        hold.recording_id for hold in list_holds(store, newest.hanger) if hold.is_for_its_clock
    ]
    of_test = store, baseline, newest, _N_NEIGHBOURS
    came = list_nearest_tests(*of_test, as_received=True, held=by_clock)
    dated = list_nearest_tests(*of_test)
    held = [each.test.id for each in (*came[0], *came[1]) if each.stage is Stage.HELD]
    watched = {each.id for each in list_watched_tests(store, baseline)}
    of_works = {
        each.test.id
        for each in (*came[0], *came[1], *dated[0], *dated[1])
        if each.id not in watched and each.stage is Stage.WATCHED
    }
    return Beside(_plain(came), _plain(dated), held, of_works)


def _plain(
    sides: tuple[Sequence[StoredTest], Sequence[StoredTest]],
) -> tuple[Sequence[ModalTest], Sequence[ModalTest]]:
    before, after = sides
    return [each.test for each in before], [each.test for each in after]


def dated_tests(
    store: Store, baseline: Baseline, newest: StoredTest | None = None
) -> tuple[list[DatedTest], list[DatedTest]]:
    """The tests of a baseline, and those since that were watched, up to and with `newest`."""
    watched = {each.id for each in list_watched_tests(store, baseline, newest)}
    later = [each for each in store.tests.list_all(baseline.hanger) if each.id in watched]
    return _dated(list_baseline_tests(store, baseline)), _dated(
        [*later, *([newest] if newest else [])]
    )


def _dated(tests: Sequence[StoredTest]) -> list[DatedTest]:
    return [(each.test, each.time) for each in tests]


def _key(tests: Sequence[TestRow], newest: StoredTest | None = None) -> str:
    """Of these tests in this order: one that came late, or is done again, makes another."""
    named = [(each.id, each.name, each.time) for each in tests]
    named += [(newest.id, newest.test.id, newest.time)] if newest else []
    text = "\n".join(f"{id_} {name} {time.isoformat()}" for id_, name, time in named)
    return f"{shm.__version__} {hashlib.sha256(text.encode()).hexdigest()}"


_RECENT_TESTS = 64  # technical: two visits of so many tests each are none of hammer tests

log = logging.getLogger(__name__)


def judge_again(workspace: Workspace, store: Store, hanger: Hanger, at: datetime) -> None:
    """Send the tests of a hanger back to the watch whose latest was judged with other thresholds.

    What is left to be judged is told by the store: a kill loses nothing.
    """
    watch = find_latest_watches(store, [hanger]).get(hanger.id)
    why = "; ".join(differences(watch, hanger, workspace.settings)) if watch else ""
    if watch and why:
        count = store.watch.rerun(hanger.id, watch.baseline_id, why, at)
        log.info("hanger %d: %d tests are judged again: %s", hanger.id, count, why)


def differences(judged: StoredWatch, hanger: Hanger, settings: Settings) -> Iterator[str]:
    """Return which thresholds in force are others than those that a test was judged with."""
    limits, watched = hanger.thresholds, judged.watched
    stated_years = limits.false_call_years
    pairs = {
        **{
            each.quantity: (each.threshold, threshold_of(each.quantity, hanger))
            for each in watched.drifts
        },
        "alert probability": (judged.alert_probability, limits.alert_probability),
        "years between false alarms": (
            watched.change.limit_years,
            settings.false_call_years if stated_years is None else stated_years,
        ),
    }
    for name, (then, now) in pairs.items():
        if then != now and not isnan(then):
            yield f"{name} {now:.6g} instead of {then:.6g}"


def reconciled(
    store: Store,
    hanger: Hanger,
    baseline: Baseline,
    test: StoredTest,
    found: tuple[WatchedTest, Alert | None],
) -> Reconciled:
    """Return which alerts to open and to close once a test was compared with a baseline.

    `found` is what the watch says, and the alert that it calls for. While other tests of the hanger
    wait to be compared once more nothing is decided: what there is lies in the past.
    """
    if not is_caught_up(store, test, baseline):
        return Reconciled()
    alerts = store.alerts.list_all(hanger.id)
    known = [each for each in alerts if each.baseline_id == baseline.id]
    watched, alert = found
    is_again = is_watched_again(store, test, baseline)
    if is_again:
        stored = store.watch.list_all(hanger.id, baseline.id)
    else:
        recent = _RECENT_TESTS if known else 0
        stored = store.watch.list_all(hanger.id, baseline.id, last=recent)
    tests = sorted([*(each.watched for each in stored), watched], key=lambda each: each.time)
    called = _called(stored, known) if is_again else []

    def is_gap_left(test: WatchedTest) -> bool:
        try:
            current = store.posteriors.get(hanger.id, test.test)
        except NothingThere:  # of a class that was dropped: not known to have ended
            return True
        return is_gap_larger(baseline.posterior, current)

    called += [alert] if alert else []
    evidence = Evidence(hanger, tests, watched.test, is_gap_left, called, is_again)
    is_open = [each for each in alerts if each.resolution is None]
    return reconcile(is_open, conditions_of(known, evidence, baseline.id))


def _called(stored: Sequence[StoredWatch], known: Sequence[StoredAlert]) -> list[Alert]:
    """Return what tests in force call for; of watches of former versions, what they raised."""
    raised = {each.alert.test: each.alert for each in known}
    called = (each.called or raised.get(each.watched.test) for each in stored)
    return [each for each in called if each is not None]
