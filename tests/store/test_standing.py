"""Where recordings stand and for how long, which tests are near which, what died on the way."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial

import pytest

from shm.errors import NothingThere, UsageError
from shm.store import Deaths, IdentifiedTest, Lineage, Stage, Store
from shm.store.queries.history import list_events
from shm.store.queries.judging import list_latest_tests, list_tests_taken_at
from shm.store.queries.recordings import (
    count_deaths,
    count_stages,
    find_oldest_waiting,
    find_recording,
    is_waiting,
    list_recordings,
    list_stage_seconds,
    list_under_way,
    list_waiting_recordings,
)
from shm.store.queries.tests import count_tests, find_neighbours
from shm.store.queries.watching import (
    find_latest_weighed,
    list_tests_by_receipt,
    list_tests_by_time,
    list_watched_tests,
    list_weighed,
)
from shm.store.stored_tests import StoredTest
from shm.values import Selection
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test, a_watched_test

HOUR, DAY = timedelta(hours=1), timedelta(days=1)
LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")


def received(store: Store, number: int, at: datetime = NOW) -> int:
    return store.recordings.receive(a_file(number), at).recording.id


def identified(store: Store, number: int, day: float, **changes: object) -> StoredTest:
    """A test of its own recording."""
    test = a_test(f"t{number}", day, **changes)
    id_ = received(store, number)
    store.tests.save(id_, [IdentifiedTest(test)], LINEAGE, NOW)
    return next(t for t in store.tests.list_all(test.hanger) if t.recording_id == id_)


def names(found: tuple[StoredTest, ...]) -> list[str]:
    return [each.test.id for each in found]


def test_what_is_under_way_says_since_when_it_stands_there(file_store: Store) -> None:
    assert find_oldest_waiting(file_store) is None
    for number in (1, 2, 3):
        received(file_store, number, NOW + number * HOUR)
    found = [IdentifiedTest(a_test("t2", 2))]
    file_store.tests.save(2, found, LINEAGE, NOW + 5 * HOUR)
    file_store.recordings.refuse(1, {"message": "empty."}, NOW + 6 * HOUR)
    standing = list_under_way(file_store)
    assert [(each.id, each.stage, each.hanger, each.since) for each in standing] == [
        (2, Stage.IDENTIFIED, 3, NOW + 5 * HOUR),
        (3, Stage.RECEIVED, None, NOW + 3 * HOUR),
    ]
    assert [each.file_name for each in standing] == ["h3-2.csv", "h3-3.csv"]
    assert find_oldest_waiting(file_store) == NOW + 2 * HOUR
    assert [each.id for each in list_waiting_recordings(file_store, 5)] == [3]
    assert list_waiting_recordings(file_store, 5, [3]) == ()
    assert is_waiting(file_store, 3, Stage.RECEIVED)
    assert not is_waiting(file_store, 2, Stage.RECEIVED)
    counts = count_stages(file_store)
    assert {stage: n for stage, n in counts.items() if n} == {
        "received": 1, "identified": 1, "refused": 1,
    }  # fmt: skip


def test_steps_take_from_the_one_before_and_only_those_made_lately_are_told(
    file_store: Store,
) -> None:
    received(file_store, 1, NOW)
    file_store.tests.save(1, [IdentifiedTest(a_test())], LINEAGE, NOW + HOUR)
    received(file_store, 2, NOW)
    file_store.recordings.refuse(2, {"message": "no."}, NOW + 2 * HOUR)
    seconds = list_stage_seconds(file_store, NOW)  # of the file, and of its test
    assert seconds == {"identified": [3600.0, 3600.0], "refused": [7200.0]}
    assert list_stage_seconds(file_store, NOW + 2 * HOUR) == {"refused": [7200.0]}
    assert list_stage_seconds(file_store, NOW + 3 * HOUR) == {}


def test_deaths_count_since_a_recording_moved_on_and_while_it_is_on_its_way(
    file_store: Store,
) -> None:
    note = file_store.recordings.note_death
    for number in (1, 2, 3):
        received(file_store, number, NOW)
    note(1, "core", NOW - HOUR)
    assert count_deaths(file_store) == {}
    note(1, "core", NOW + HOUR)
    note(2, "killed", NOW + HOUR)
    note(1, "killed", NOW + 2 * HOUR)
    note(3, "core", NOW + 2 * HOUR)
    file_store.recordings.refuse(3, {"message": "no."}, NOW + 3 * HOUR)
    assert count_deaths(file_store) == {
        1: Deaths(2, NOW + 2 * HOUR),
        2: Deaths(1, NOW + HOUR),
    }
    kinds = [(each.kind, each.message) for each in list_events(file_store, recording_id=2)]
    assert kinds == [("worker died", "killed")]


def test_a_file_that_was_too_large_leaves_its_name_and_no_recording(file_store: Store) -> None:
    file_store.recordings.refuse_unread("big.csv", "5 GB.", NOW)
    (event,) = list_events(file_store)
    assert (event.kind, event.file_name, event.message, event.at, event.recording_id) == (
        "refused", "big.csv", "5 GB.", NOW, None,
    )  # fmt: skip
    assert list_recordings(file_store) == ()


def test_a_recording_is_found_by_number_test_and_file_name(filled_copy: Store) -> None:
    find = partial(find_recording, filled_copy)
    assert [find("2"), find("t2"), find("h3-2.csv"), find("h3-2")] == [
        (2, None), (2, "t2"), (2, None), (2, None),
    ]  # fmt: skip
    for unknown in ("99", "t9"):
        with pytest.raises(NothingThere, match=f"no recording and no test '{unknown}'"):
            find(unknown)
    filled_copy.recordings.receive(a_file(9, file_name="h3-2.csv"), NOW)
    with pytest.raises(UsageError, match="2 recordings were called"):
        find("h3-2.csv")


def test_the_latest_tests_of_a_hanger_by_time_and_by_receipt(file_store: Store) -> None:
    for number, day in ((1, 5), (2, 1), (3, 3), (4, 2)):
        identified(file_store, number, day)
    identified(file_store, 5, 9, hanger=4)
    latest = partial(list_latest_tests, file_store)
    assert names(latest(3, 99, 3)) == ["t4", "t3", "t1"]
    assert names(latest(3, 99, 3, as_received=True)) == ["t2", "t3", "t4"]
    assert names(latest(3, 3, 9)) == ["t2", "t4", "t1"]
    assert names(latest(3, 3, 9, as_received=True)) == ["t1", "t2", "t4"]
    told = {h: (each.tests, each.time) for h, each in count_tests(file_store).items()}
    assert told == {3: (4, NOW + 5 * DAY), 4: (1, NOW + 9 * DAY)}


def test_a_test_of_the_very_same_time_is_another_recordings(file_store: Store) -> None:
    first, second = identified(file_store, 1, 5), identified(file_store, 2, 5)
    identified(file_store, 3, 5.001)
    at = first.time
    assert names(list_tests_taken_at(file_store, 3, at, second.recording_id)) == ["t1"]
    assert names(list_tests_taken_at(file_store, 3, at, first.recording_id)) == ["t2"]
    assert list_tests_taken_at(file_store, 4, at, second.recording_id) == ()
    assert list_tests_taken_at(file_store, 3, at + HOUR, second.recording_id) == ()


def test_the_latest_test_whose_tension_was_read(file_store: Store) -> None:
    plain = identified(file_store, 1, 5)
    read = [
        identified(file_store, n, day, tension_read_n=7e5, tension_read_sd_n=5e3)
        for n, day in ((2, 1), (3, 3))
    ]
    assert list_weighed(file_store, [plain.id, *(each.id for each in read)]) == {e.id for e in read}
    for before, name in ((9, "t3"), (3, "t2")):
        found = find_latest_weighed(file_store, [3, 4], NOW + before * DAY)
        assert found is not None
        assert found.test.id == name
    assert find_latest_weighed(file_store, [3], NOW + DAY) is None
    assert find_latest_weighed(file_store, [4], NOW + 9 * DAY) is None


def watched_season(store: Store) -> list[StoredTest]:
    """Five tests, the first the baseline's, received in another order than they were taken in."""
    found = [identified(store, number, day) for number, day in enumerate((1, 9, 3, 7, 5), start=1)]
    made = Selection((a_posterior("beam1"),), (1.0,))
    store.posteriors.save_selection(3, [found[0]], made, LINEAGE, NOW)
    baseline = store.watch.baseline(3)
    assert baseline is not None
    for test in found[1:]:
        store.posteriors.save(test, a_posterior("beam1", (test.test.id,)), LINEAGE, NOW)
        watched = replace(a_watched_test(test.test.id), time=test.time)
        store.watch.save(test, baseline, watched, None, [], NOW)
    return list(store.tests.list_all(3))


def test_the_tests_beside_one_by_time_and_by_receipt_nearest_first(file_store: Store) -> None:
    by_name = {each.test.id: each for each in watched_season(file_store)}
    baseline = file_store.watch.baseline(3)
    assert baseline is not None
    middle = by_name["t4"]
    before, after = list_tests_by_time(file_store, baseline, middle, 9)
    assert (names(before), names(after)) == (["t5", "t3"], ["t2"])
    before, after = list_tests_by_time(file_store, baseline, middle, 1)
    assert (names(before), names(after)) == (["t5"], ["t2"])
    before, after = list_tests_by_receipt(file_store, baseline, middle, 9)
    assert (names(before), names(after)) == (["t3", "t2"], ["t5"])
    assert find_neighbours(file_store, middle) == ("t5", "t2")
    assert find_neighbours(file_store, by_name["t1"]) == (None, "t3")
    assert find_neighbours(file_store, by_name["t2"]) == ("t4", None)


def test_watched_tests_are_listed_page_by_page(file_store: Store) -> None:
    watched_season(file_store)
    baseline = file_store.watch.baseline(3)
    assert baseline is not None
    listed = list_watched_tests(file_store, baseline)
    assert [each.name for each in listed] == ["t3", "t5", "t4", "t2"]
    fourth = file_store.tests.named(3, "t4")
    before = list_watched_tests(file_store, baseline, fourth)
    assert [each.name for each in before] == ["t3", "t5"]
    recent = file_store.watch.list_all(3, baseline.id, last=2)
    assert [each.watched.test for each in recent] == ["t4", "t2"]
    assert [each.watched.test for each in file_store.watch.list_all(3)] == ["t3", "t5", "t4", "t2"]
