"""Where recordings stand and for how long, which tests are near which, what died on the way."""

from __future__ import annotations

from datetime import datetime, timedelta

from shm.store import Deaths, IdentifiedTest, Store
from shm.store.journal import list_events
from shm.store.recordings import (
    count_deaths,
    list_stage_seconds,
)
from tests.helpers.entering import LINEAGE
from tests.helpers.nouns import NOW, a_file, a_test

HOUR = timedelta(hours=1)


def received(store: Store, number: int, at: datetime = NOW) -> int:
    return store.recordings.receive(a_file(number), at).recording.id


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
