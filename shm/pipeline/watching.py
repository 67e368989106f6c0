"""Which tests of a hanger the watch goes over, and from where it goes on.

Nothing here imports what computes, so that the daemon itself begins quickly and stays small.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import shm
from shm.store import Baseline, Stage, Store, StoredTest, WatchedName
from shm.values import Beside, ModalTest

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
    key = _key([*before, WatchedName(newest.id, newest.test.id, newest.time)])
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


def _key(tests: Sequence[WatchedName]) -> str:
    """Of these tests in this order: one that came late, or is done again, makes another."""
    told = "\n".join(f"{each.id} {each.name} {each.time.isoformat()}" for each in tests)
    return f"{shm.__version__} {hashlib.sha256(told.encode()).hexdigest()}"
