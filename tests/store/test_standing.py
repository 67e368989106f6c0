"""Where recordings stand and for how long, which tests are near which, what died on the way."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta

from shm.store import Deaths, IdentifiedTest, Lineage, Store
from shm.store.queries.history import list_events
from shm.store.queries.recordings import (
    count_deaths,
    list_stage_seconds,
)
from shm.store.queries.tests import find_neighbours
from shm.store.queries.watching import (
    find_latest_weighed,
    list_tests_by_receipt,
    list_tests_by_time,
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
