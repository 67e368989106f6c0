"""What people decide of recordings, from confirmed to reinstated, and what follows."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from shm.errors import NothingThere, UsageError
from shm.store import Stage, Store
from shm.store.queries.history import list_changes
from shm.store.queries.judging import list_decisions
from shm.store.queries.recordings import find_discard, find_latest_hold, list_holds
from shm.store.rows import Decision
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


def test_what_waits_for_a_decision_is_listed_by_hanger(store: Store) -> None:
    (hold,) = list_holds(store)
    assert (hold.recording_id, hold.decision) == (HELD, None)
    assert [(each.name, each.position) for each in hold.tests] == [("t6", 0)]
    assert list_holds(store, 3) == ()
    assert find_latest_hold(store, HELD) == hold
    assert find_latest_hold(store, 1) is None
    confirmed = find_latest_hold(store, CONFIRMED)
    assert confirmed is not None
    assert (confirmed.decision, confirmed.who, confirmed.why) == (
        Decision.CONFIRMED,
        "engineer",
        "battery was flat",
    )
    assert (confirmed.is_in, confirmed.is_out) == (True, False)
    assert find_discard(store, CONFIRMED) is None


def test_a_held_test_that_is_confirmed_counts_at_the_time_that_is_given(store: Store) -> None:
    hold = store.recordings.accept(HELD, "Ada", "it was there", LATER, NOW + DAY)
    assert (hold.decision, hold.who, hold.why, hold.time, hold.decided_at) == (
        Decision.CONFIRMED, "Ada", "it was there", NOW + DAY, LATER,
    )  # fmt: skip
    assert stage(store, HELD) == Stage.IDENTIFIED
    assert list_holds(store) == ()
    (test,) = [each for each in store.tests.list_all(5) if each.test.id == "t6"]
    assert test.test.time == test.time == NOW + DAY
    with pytest.raises(UsageError, match="is not held: it was confirmed by Ada"):
        store.recordings.accept(HELD, "Ben", "", LATER)


def test_a_test_of_unknown_time_counts_from_its_receipt(store: Store) -> None:
    store.recordings.accept(HELD, "Ada", "", LATER)
    (test,) = [each for each in store.tests.list_all(5) if each.test.id == "t6"]
    assert test.test.time is None
    assert test.time == NOW


def test_a_time_yet_to_come_is_refused_and_nothing_changes(store: Store) -> None:
    with pytest.raises(UsageError, match="yet to come"):
        store.recordings.accept(HELD, "Ada", "", LATER, LATER + DAY)
    assert stage(store, HELD) == Stage.HELD
    store.recordings.accept(HELD, "Ada", "", LATER, LATER)


def test_what_counts_is_not_accepted(store: Store) -> None:
    decide = store.recordings.accept
    with pytest.raises(NothingThere, match="no recording 99"):
        store.recordings.exclude(99, "Ada", "", LATER)
    with pytest.raises(NothingThere, match="no recording 99"):
        decide(99, "Ada", "", LATER)
    with pytest.raises(UsageError, match="nothing of recording 2 is held"):
        decide(WATCHED, "Ada", "", LATER)
    with pytest.raises(UsageError, match="it was confirmed by engineer") as refused:
        decide(CONFIRMED, "Ada", "", LATER)
    assert "shm ingest --discard 5 --why TEXT" in str(refused.value)


def test_what_is_discarded_says_who_and_why_and_how_to_take_it_back(store: Store) -> None:
    hold = store.recordings.exclude(HELD, "Ada", "a copy", LATER).hold
    assert hold == find_discard(store, HELD)
    assert (hold.decision, hold.is_in, hold.is_out) == (Decision.DISCARDED, False, True)
    recording = store.recordings.get(HELD)
    assert recording.stage == Stage.REFUSED
    assert recording.reason is not None
    assert recording.reason["message"] == "discarded on 2026-05-21 by Ada, because: a copy."
    assert "shm ingest --confirm 6 --why TEXT" in recording.reason["remedy"]
    assert counting(store, 5) == ["t5"]
    assert list_holds(store) == ()
    assert list_decisions(store, HELD, None) == {0: hold}
    assert list_decisions(store, HELD, "other.toml") == {}
    assert list_decisions(store, WATCHED, None) == {}


def test_what_was_discarded_is_reinstated_as_it_would_have_been(store: Store) -> None:
    store.recordings.exclude(HELD, "Ada", "a copy", LATER)
    hold = store.recordings.accept(HELD, "Ben", "no copy", LATER + DAY, NOW + DAY)
    assert (hold.decision, hold.who, hold.time) == (Decision.REINSTATED, "Ben", NOW + DAY)
    assert hold.is_in
    assert [(each.name, each.doubts[0].check) for each in hold.tests] == [("t6", "copy")]
    recording = store.recordings.get(HELD)
    assert (recording.stage, recording.reason) == (Stage.IDENTIFIED, None)
    assert counting(store, 5) == ["t6", "t5"]  # in the order of their times
    assert find_discard(store, HELD) is None
    with pytest.raises(UsageError, match="nothing of recording 6 is held or discarded"):
        store.recordings.accept(HELD, "Ben", "", LATER)
    with pytest.raises(UsageError, match="nothing of recording 3 is held or discarded"):
        store.recordings.accept(REFUSED, "Ben", "", LATER)


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


def test_a_withdrawal_is_taken_back(store: Store) -> None:
    store.recordings.exclude(WATCHED, "Ada", "", LATER)
    hold = store.recordings.accept(WATCHED, "Ben", "it was right", LATER)
    assert [each.name for each in hold.tests] == ["t2"]
    assert counting(store, 3) == ["t1", "t2", "t4"]
    assert stage(store, WATCHED) == Stage.IDENTIFIED
    assert [each.decision for each in (hold, find_latest_hold(store, WATCHED)) if each] == [
        Decision.REINSTATED
    ] * 2


def test_a_test_of_another_name_is_not_withdrawn(store: Store) -> None:
    with pytest.raises(UsageError, match="does not count"):
        store.recordings.exclude(WATCHED, "Ada", "", LATER, test="t1")
    store.recordings.exclude(WATCHED, "Ada", "", LATER, test="t2")
    with pytest.raises(UsageError, match="nothing of recording"):
        store.recordings.accept(WATCHED, "Ada", "", LATER, test="t1")
    assert store.recordings.accept(WATCHED, "Ada", "", LATER, test="t2").is_in


def test_each_decision_is_noted_with_its_reason(store: Store) -> None:
    store.recordings.exclude(WATCHED, "Ada", "the wrong hanger", LATER)
    store.recordings.exclude(HELD, "Ada", "a copy", LATER)
    newest = [(row.who, row.action, row.detail) for row in list_changes(store, 2)]
    assert newest == [
        ("Ada", "recording discarded", "a copy"),
        ("Ada", "recording withdrawn", "t2: the wrong hanger"),
    ]
