"""Which tests the watch goes over, what a watched test raises and ends, which are judged again.

Nothing here imports what computes, so that the daemon itself begins quickly and stays small.

A threshold judges the stored tests too: at once they are compared with their baseline again. A loss
that only the new one calls is raised; an alert that no test is beyond any more is closed, and says
why. What was told before is not told again.

Nothing here imports what computes, so that the daemon itself begins quickly and stays small.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from math import isnan
from typing import TYPE_CHECKING

import shm
from shm.errors import NothingThere
from shm.pipeline.ending import (
    BEYOND,
    OF_CHANGES,
    SHM,
    gap_stands,
    is_told,
    message_anew,
    seen_again,
    tells,
    why_over,
)
from shm.settings import Settings
from shm.store import Baseline, Stage, Store, StoredAlert, StoredTest, TestRow, Workspace
from shm.store.rows import StoredWatch
from shm.values import Alert, Beside, Hanger, ModalTest, WatchedTest
from shm.values.drift import threshold_of

if TYPE_CHECKING:
    from shm.watch import DatedTest


_BESIDE = 2  # of which two that agree have been told before


@dataclass(frozen=True)
class ToWatch:
    """What a watch needs: the tests of the baseline and those to go over, the newest last.

    With something `kept` the newest goes alone. `key` tells what is kept after it from what was
    kept after other tests, or by another shm.
    """

    baseline_tests: Sequence[DatedTest]
    later: Sequence[DatedTest]
    kept: bytes | None
    key: str


def to_watch(store: Store, baseline: Baseline, newest: StoredTest) -> ToWatch:
    """What the watch of a test needs; how many tests there were before costs next to nothing."""
    before, kept = store.watch.list_watched(baseline, newest), store.watch.state(baseline)
    key = _key(before, newest)
    if kept is None or kept.key != _key(before):
        return ToWatch(*dated_tests(store, baseline, newest), None, key)
    return ToWatch(_dated(store.tests.of_baseline(baseline)), _dated([newest]), kept.content, key)


def tests_beside(store: Store, baseline: Baseline, newest: StoredTest) -> Beside:
    """The tests that a test may agree with: two each way, as they came in and by their clocks.

    What is held for its clock alone came in as any other: what it measured is in no doubt. Tests
    that were passed over for planned works count here alone: a loss that lasts agrees with them.
    """
    by_clock = [
        hold.recording_id
        for hold in store.recordings.list_holds(newest.hanger)
        if hold.is_for_its_clock
    ]
    came = store.tests.received_beside(baseline, newest, _BESIDE, by_clock)
    dated = store.tests.dated_beside(baseline, newest, _BESIDE)
    held = [each.test.id for each in (*came[0], *came[1]) if each.stage is Stage.HELD]
    watched = {each.id for each in store.watch.list_watched(baseline)}
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
    watched = {each.id for each in store.watch.list_watched(baseline, newest)}
    later = [each for each in store.tests.list_all(baseline.hanger) if each.id in watched]
    return _dated(store.tests.of_baseline(baseline)), _dated(
        [*later, *([newest] if newest else [])]
    )


def _dated(tests: Sequence[StoredTest]) -> list[DatedTest]:
    return [(each.test, each.time) for each in tests]


def _key(tests: Sequence[TestRow], newest: StoredTest | None = None) -> str:
    """Of these tests in this order: one that came late, or is done again, makes another."""
    named = [(each.id, each.name, each.time) for each in tests]
    named += [(newest.id, newest.test.id, newest.time)] if newest else []
    told = "\n".join(f"{id_} {name} {time.isoformat()}" for id_, name, time in named)
    return f"{shm.__version__} {hashlib.sha256(told.encode()).hexdigest()}"


_RECENT_TESTS = 64  # technical: two visits of so many tests each are none of hammer tests
_CLOSED = "judged again with the thresholds in force"

log = logging.getLogger(__name__)


class JudgedAgain:
    """Sends back the tests of each hanger whose latest was judged with other thresholds.

    One hanger at a time, so that what comes in meanwhile waits for no other hanger's; those of a
    new test go first, since it is judged after them. Who is left is told by the store: nothing is
    lost where the process is killed.
    """

    def __init__(self, workspace: Workspace, store: Store):
        self._store, self._judging = store, -1
        self._left: dict[int, tuple[int, str]] = {}
        latest = store.watch.latest()
        for hanger in workspace.bridge.watched:
            if watch := latest.get(hanger.id):
                why = "; ".join(differences(watch, hanger, workspace.settings))
                self._left |= {hanger.id: (watch.baseline_id, why)} if why else {}

    def go_on(
        self, at: datetime, held: Collection[int] = (), damaged: Collection[int | None] = ()
    ) -> None:
        """Sends the next back where it is time; recordings that are held and hangers that stand
        still are not waited for.
        """
        if not self._left:
            return
        waiting = {test.hanger for test in self._store.tests.list_waiting(1, excluding=held)}
        for hanger in waiting & self._left.keys():
            self._send_back(hanger, at)
        while self._left and self._judging not in waiting - set(damaged):
            hanger = next(iter(self._left))
            if self._send_back(hanger, at):
                return

    def _send_back(self, hanger: int, at: datetime) -> int:
        baseline_id, why = self._left.pop(hanger)
        self._judging = hanger
        count = self._store.watch.judge_again(hanger, baseline_id, why, at)
        said = "hanger %d: %d tests are judged again, %d hangers are left: %s"
        log.info(said, hanger, count, len(self._left), why)
        return count


def differences(judged: StoredWatch, hanger: Hanger, settings: Settings) -> Iterator[str]:
    """Which thresholds in force are others than those that a test was judged with."""
    limits, watched = hanger.thresholds, judged.watched
    own = limits.false_call_years
    pairs = {
        **{
            each.quantity: (each.threshold, threshold_of(each.quantity, hanger))
            for each in watched.drifts
        },
        "alert probability": (judged.alert_probability, limits.alert_probability),
        "years between false alarms": (
            watched.change.limit_years,
            settings.false_call_years if own is None else own,
        ),
    }
    for name, (then, now) in pairs.items():
        if then != now and not isnan(then):
            yield f"{name} {now:.6g} instead of {then:.6g}"


def settled(
    store: Store,
    hanger: Hanger,
    baseline: Baseline,
    test: StoredTest,
    found: tuple[WatchedTest, Alert | None, frozenset[tuple[str, str]]],
) -> tuple[dict[int, str], Alert | None]:
    """Which alerts a test ends, and why; and the one to raise: that of the watch, unless the same
    was told, or else a resolved one that is seen again.

    `found` is what the watch says, its alert, and what stands beyond its threshold. Of tests that
    are done again only the last can end anything: those between are of the past.
    """
    watched, alert, beyond = found
    standing = store.alerts.list_all(hanger.id, baseline.id, standing=True)
    resolved = store.alerts.list_all(hanger.id, baseline.id, standing=False)
    is_again = store.watch.is_again(test, baseline)
    if alert and is_again:
        said = f"{alert.message} Raised when the stored tests were judged again."
        alert = replace(alert, message=said)
    if not standing and not resolved:
        return {}, alert
    closed = [each for each in resolved if _is_closed(each)]
    resolved = tuple(each for each in resolved if not _is_closed(each))
    if alert and is_again:
        alert = _with_own_key(alert, closed)
    if is_again and not store.watch.is_last(test, baseline):
        known = [*standing, *_of_the_past(alert, resolved)]
        alert = alert and _news(alert, known)
        return _replaced(alert, standing), alert
    before = [each.watched for each in store.watch.list_recent(baseline, _RECENT_TESTS)]
    tests = sorted([*before, watched], key=lambda each: each.time)

    def stands(test: WatchedTest) -> bool:
        try:
            current = store.posteriors.get(hanger.id, test.test)
        except NothingThere:  # of a class that was dropped: not known to have ended
            return True
        return gap_stands(baseline.posterior, current)

    ended = {
        each.id: why
        for each in standing
        if (why := why_over(each.alert, tests, hanger, gap_stands=stands))
        or (is_again and (why := _why_closed(each.alert, tests, hanger, beyond)))
    }
    if is_again and any(each.change.called for each in tests):
        alert = alert or _detected_still(standing, ended, watched, hanger)
    # The gap's alert has one key for good: what was raised before is raised no second time.
    if alert and alert.key not in {each.alert.key for each in (*standing, *resolved)}:
        left = [each for each in standing if each.id not in ended]
        past = _of_the_past(alert, resolved) if is_again else []
        alert = _news(alert, [*left, *past])
        return ended | (_replaced(alert, standing) if is_again else {}), alert
    return ended, seen_again(resolved, standing, tests, hanger, gap_stands=stands) or alert


def _news(alert: Alert, known: Sequence[StoredAlert]) -> Alert | None:
    told = [each.alert for each in known]
    return None if is_told(alert, told) else alert


def _of_the_past(alert: Alert | None, resolved: Sequence[StoredAlert]) -> list[StoredAlert]:
    """Resolved alerts that a test done again must not raise anew: a person has looked into it
    since, or it was told of that test or a later one and has ended."""
    return [
        each
        for each in resolved
        if alert and (end := each.resolution)
        if alert.time <= (each.alert.time if end.who == SHM else end.at)
    ]


def _why_closed(
    alert: Alert, tests: Sequence[WatchedTest], hanger: Hanger, beyond: frozenset[tuple[str, str]]
) -> str:
    """Why an alert would not have been raised by what is in force now; empty where it would."""
    kinds = set(alert.kinds)
    if not kinds <= OF_CHANGES:
        return ""
    if BEYOND not in kinds and any(each.change.called for each in tests):
        return ""
    told = {(each.quantity, "down" if each.shift_mean < 0 else "up") for each in alert.drifts}
    if BEYOND in kinds and told & beyond:
        return ""
    limits = hanger.thresholds
    return (
        f"{_CLOSED} (tension {100 * limits.tension_shift_fraction:.3g} %, end stiffness "
        f"{limits.stiffness_shift_decades:.3g} decades, probability "
        f"{limits.alert_probability:.3g}): its tests are not beyond them"
    )


def _is_closed(stored: StoredAlert) -> bool:
    """Whether other thresholds have closed an alert, not the hanger's tests or a person."""
    return stored.resolution is not None and stored.resolution.why.startswith(_CLOSED)


def _with_own_key(alert: Alert, closed: Sequence[StoredAlert]) -> Alert:
    """An alert that other thresholds have closed may be raised again: under another key."""
    same = [each.id for each in closed if each.alert.key.partition(":again-")[0] == alert.key]
    return replace(alert, key=f"{alert.key}:again-{max(same)}") if same else alert


def _replaced(alert: Alert | None, standing: Sequence[StoredAlert]) -> dict[int, str]:
    """What stands of a change that is now raised as beyond its threshold: one alert a loss."""
    if alert is None or BEYOND not in alert.kinds:
        return {}
    told = [each for each in standing if set(each.alert.kinds) <= OF_CHANGES - {BEYOND}]
    why = f"{_CLOSED}: another alert tells that it is beyond its threshold"
    return {each.id: why for each in told if tells(each.alert, alert.change)}


def _detected_still(
    standing: Sequence[StoredAlert], ended: Mapping[int, str], test: WatchedTest, hanger: Hanger
) -> Alert | None:
    """What is left of an alert that is not beyond its threshold any more: the change."""
    for stored in standing:
        alert, why = stored.alert, ended.get(stored.id, "")
        if not why.startswith(_CLOSED) or alert.change is None or set(alert.kinds) == {BEYOND}:
            continue
        if any(tells(each.alert, alert.change) for each in standing if each.id not in ended):
            continue
        told = {each.quantity for each in alert.drifts}
        drifts = tuple(each for each in test.drifts if each.quantity in told)
        return replace(
            alert,
            key=f"{alert.key.partition(':again-')[0]}:again-{stored.id}",
            test=test.test,
            time=test.time,
            drifts=drifts,
            kinds=tuple(each for each in alert.kinds if each != BEYOND),
            message=f"{message_anew(alert, drifts, test, hanger)} It replaces alert {stored.id}.",
        )
    return None
