"""What people decide of recordings, from confirmed to reinstated, and what follows."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from shm.errors import UsageError
from shm.store import Stage, Store
from shm.store.journal import change_document, list_changes
from shm.store.recordings import count_stages, find_discard
from shm.store.rows import Decision
from shm.store.tests import list_decisions
from tests.helpers.nouns import NOW, a_watched_test

DAY = timedelta(days=1)
LATER = NOW + 20 * DAY
WATCHED, REFUSED, UPDATED_AGAIN, CONFIRMED, HELD = 2, 3, 4, 5, 6
"""Recordings of the filled store by what became of them."""


def _watch_at_its_time(store: Store) -> None:
    store.recordings.rerun(UPDATED_AGAIN, Stage.WATCHED, NOW)
    third, baseline = store.tests.list_all(3)[-1], store.watch.baseline(3)
    assert baseline is not None
    store.watch.save(third, baseline, replace(a_watched_test("t4"), time=third.time), None, [], NOW)


@pytest.fixture
def store(filled_copy: Store) -> Store:
    return filled_copy


def stage(store: Store, recording: int) -> Stage:
    return store.recordings.get(recording).stage


def counting(store: Store, hanger: int) -> list[str]:
    return [each.test.id for each in store.tests.list_all(hanger)]


def test_decisions_of_a_recording_with_one_sidecar(store: Store) -> None:
    hold = store.recordings.exclude(HELD, "Ada", "a copy", LATER).hold
    assert hold == find_discard(store, HELD)
    assert (hold.decision, hold.is_in, hold.is_out) == (Decision.DISCARDED, False, True)
    assert list_decisions(store, HELD, None) == {0: hold}
    assert list_decisions(store, HELD, "other.toml") == {}
    assert list_decisions(store, WATCHED, None) == {}


def test_what_is_withdrawn_counts_no_more_and_later_tests_are_watched_again(store: Store) -> None:
    _watch_at_its_time(store)
    watched = [each.watched.test for each in store.watch.list_all(3)]
    assert watched == ["t2", "t4"]
    found = store.recordings.exclude(WATCHED, "Ada", "the wrong hanger", LATER)
    assert (found.hold.decision, found.hold.who) == (Decision.WITHDRAWN, "Ada")
    assert found.hold.is_out
    assert found.of_baseline == ("t2",)
    assert found.since == NOW + 2 * DAY
    assert found.watched_again == 1
    assert counting(store, 3) == ["t1", "t4"]
    assert store.watch.list_all(3) == ()
    assert stage(store, UPDATED_AGAIN) == Stage.UPDATED
    recording = store.recordings.get(WATCHED)
    assert recording.stage == Stage.REFUSED
    assert recording.reason is not None
    assert recording.reason["message"] == (
        "discarded on 2026-05-21 by Ada, because: the wrong hanger."
    )
    with pytest.raises(UsageError, match="recording 2 does not count: it was discarded"):
        store.recordings.exclude(WATCHED, "Ada", "", LATER)
    with pytest.raises(UsageError, match="recording 3 does not count: it is refused"):
        store.recordings.exclude(REFUSED, "Ada", "", LATER)


def test_each_decision_is_noted_with_its_reason(store: Store) -> None:
    store.recordings.exclude(WATCHED, "Ada", "the wrong hanger", LATER)
    store.recordings.exclude(HELD, "Ada", "a copy", LATER)
    counts = count_stages(store)
    assert (counts["discarded"], counts["refused"]) == (2, 1)
    newest = [tuple(change_document(row).values()) for row in list_changes(store, 2)]
    newest = [(who, action, detail) for *_, who, _via, action, _of, detail in newest]
    assert newest == [
        ("Ada", "recording discarded", "a copy"),
        ("Ada", "recording withdrawn", "t2: the wrong hanger"),
    ]
