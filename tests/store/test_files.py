"""Received files: each once, whatever is dropped again."""

from __future__ import annotations

from shm.store import IdentifiedTest, Judgement, Outcome, Stage, Store
from shm.store.journal import list_events, list_former_tests, list_steps
from shm.store.recordings import (
    is_waiting,
    list_recordings,
)
from tests.helpers.entering import LINEAGE
from tests.helpers.nouns import NOW, a_file, a_test

REASON = {"message": "no sampling rate.", "remedy": "Give it.", "sha256": "1"}


def test_the_same_bytes_with_another_sidecar_are_done_again_with_that(store: Store) -> None:
    first = store.recordings.receive(a_file(1, sidecar_as="11/1.toml"), NOW).recording.id
    found = [IdentifiedTest(a_test())]
    store.tests.save(first, found, LINEAGE, NOW, Judgement("11/1.toml"))
    described = a_file(1, arrival="other", sidecar_as="22/2.toml")
    again = store.recordings.receive(described, NOW)
    assert again.outcome is Outcome.REDESCRIBED
    assert again.recording.file.sidecar_as == "22/2.toml"
    assert again.recording.stage is Stage.RECEIVED
    assert store.tests.list_all(3) == ()
    assert len(list_former_tests(store, first)) == 1
    assert "another sidecar" in list_events(store, "redescribed")[0].message
    assert store.recordings.receive(described, NOW).outcome is Outcome.RESUMED
    late = Judgement("11/1.toml")  # what was begun with the sidecar of before
    store.tests.save(first, found, LINEAGE, NOW, late)
    assert store.recordings.get(first).stage is Stage.RECEIVED


def test_a_receipt_cut_short_by_a_crash_is_no_duplicate(store: Store) -> None:
    store.recordings.receive(a_file(1), NOW)
    assert store.recordings.receive(a_file(1), NOW).outcome is Outcome.RESUMED
    assert list_events(store) == ()
    assert len(list_recordings(store)) == 1


def test_only_what_still_waits_at_a_stage_is_refused_from_there(store: Store) -> None:
    """Two processes at the same step: the second neither doubles nor undoes what the first did."""
    first, second = (
        store.recordings.receive(a_file(number), NOW).recording.id for number in (1, 2)
    )
    for _ in range(2):
        store.recordings.refuse(first, REASON, NOW, stage=Stage.RECEIVED)
    assert len(list_events(store, "refused")) == 1
    assert [step.kind for step in list_steps(store, first)].count(Stage.REFUSED) == 1
    store.tests.save(second, [IdentifiedTest(a_test("t2"))], LINEAGE, NOW)
    (test,) = store.tests.list_all()
    assert not is_waiting(store, second, Stage.RECEIVED)
    store.recordings.refuse(second, REASON, NOW, stage=Stage.RECEIVED)
    store.recordings.refuse(second, REASON, NOW, [test.id], stage=Stage.UPDATED)
    assert store.recordings.get(second).stage is Stage.IDENTIFIED
    assert is_waiting(store, second, Stage.IDENTIFIED, [test.id])
    store.recordings.refuse(second, REASON, NOW, [test.id], stage=Stage.IDENTIFIED)
    assert store.recordings.get(second).stage is Stage.REFUSED
    assert not is_waiting(store, second, Stage.IDENTIFIED, [test.id])


def test_files_refused_together_each_end_with_their_own_tests(store: Store) -> None:
    ids = [store.recordings.receive(a_file(number), NOW).recording.id for number in (1, 2)]
    for number in ids:
        store.tests.save(number, [IdentifiedTest(a_test(f"t{number}"))], LINEAGE, NOW)
    tests = [test.id for test in store.tests.list_all()]
    for number in ids:
        store.recordings.refuse(number, REASON, NOW, tests, stage=Stage.IDENTIFIED)
    for number in ids:
        stages = [step.kind for step in list_steps(store, number)]
        assert stages.count(Stage.REFUSED) == 2  # the file and its test


def test_the_spool_entry_of_a_refused_file_left_by_a_crash_is_not_tried_again(
    store: Store,
) -> None:
    recording = store.recordings.receive(a_file(1), NOW).recording
    store.recordings.refuse(recording.id, REASON, NOW)
    assert store.recordings.receive(a_file(1), NOW).outcome is Outcome.RESUMED
    assert store.recordings.get(recording.id).stage is Stage.REFUSED


def test_trying_again_drops_refused_tests_and_keeps_those_that_have_results(store: Store) -> None:
    recording = store.recordings.receive(a_file(1), NOW).recording
    found = [IdentifiedTest(a_test("good"), 0), IdentifiedTest(a_test("bad"), 1)]
    store.tests.save(recording.id, found, LINEAGE, NOW)
    good, bad = store.tests.list_all()
    store.recordings.refuse(recording.id, REASON, NOW, [bad.id])
    assert [test.test.id for test in store.tests.list_all()] == ["good"]
    store.recordings.receive(a_file(1, arrival="later"), NOW)
    store.tests.save(recording.id, found, LINEAGE, NOW)
    assert [test.test.id for test in store.tests.list_all()] == ["good", "bad"]
    assert store.tests.list_all()[0].id == good.id
