"""Doing work again: what it replaces stays with its lineage, and nothing shows it by mistake."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from shm.errors import NothingThere, UsageError
from shm.store import Baseline, IdentifiedTest, Stage, Store, StoredTest
from shm.store.journal import list_events, list_former_tests
from shm.store.posteriors import list_history, list_posteriors
from shm.store.recordings import find_recording
from shm.store.tests import list_waiting_tests
from tests.helpers.entering import LINEAGE, identified, selected, updated, watch
from tests.helpers.nouns import NOW, a_file, a_test

OLD, NEW = LINEAGE, replace(LINEAGE, version="0.2.0")
LATER = NOW + timedelta(days=400)


def with_baseline(store: Store) -> Baseline:
    return selected(store, [identified(store, 1)])


def watched(store: Store, test: StoredTest, seed: int = 1) -> None:
    updated(store, test, seed, OLD if seed == 1 else NEW)
    watch(store, test, kept=b"state")


def test_identifying_again_keeps_the_old_result_beside_the_new_one(store: Store) -> None:
    with_baseline(store)
    second = identified(store, 2)
    watched(store, second)
    rerun = store.recordings.rerun(second.recording_id, Stage.IDENTIFIED, LATER)
    assert (rerun.tests, rerun.posteriors, rerun.watches, rerun.of_baseline) == (("t2",), 1, 1, ())
    assert rerun.recording.stage is Stage.RECEIVED
    assert [test.test.id for test in store.tests.list_all(3)] == ["t1"]
    assert list_waiting_tests(store) == ()
    assert [test.test.id for test, _ in list_history(store, 3)] == ["t1"]
    assert (store.watch.list_drifts(3), store.watch.list_all(3)) == ((), ())

    again = identified(store, 2, lineage=NEW)
    assert again.test.id == "t2"
    assert again.id != second.id
    watched(store, again, seed=2)
    former, present = list_former_tests(store, again.recording_id)
    assert (former.superseded_at, present.superseded_at) == (LATER, None)
    assert (former.lineage, present.lineage) == (OLD, NEW)
    assert [made.superseded_at for made in former.posteriors] == [LATER]
    assert [made.lineage.version for made in present.posteriors] == ["0.2.0"]
    assert store.posteriors.get(3, "t2").seed == 2
    assert len(list_posteriors(store, 3)) == 2
    assert [drift.test for drift in store.watch.list_drifts(3)] == ["t2"]
    assert list_events(store, "again")[0].recording_id == second.recording_id


@pytest.mark.parametrize("stage", [Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED])
def test_what_has_not_come_so_far_cannot_be_done_again(store: Store, stage: Stage) -> None:
    recording = store.recordings.receive(a_file(1), NOW).recording
    with pytest.raises(UsageError, match="not come so far"):
        store.recordings.rerun(recording.id, stage, LATER)
    assert list_events(store) == ()


def test_a_renamed_file_is_found_by_both_names(store: Store) -> None:
    """With another sidecar, as a duplicate, or after its refusal: `--of` lost the old name."""
    test = identified(store, 1)  # of h3-1.csv
    sent = a_file(1, file_name="crew/new.uff", arrival="again", sidecar_as="22/2.toml")
    recording = store.recordings.receive(sent, LATER).recording
    assert recording.file.file_name == "crew/new.uff"
    store.tests.save(recording.id, [IdentifiedTest(a_test("new"))], NEW, LATER)
    store.recordings.receive(a_file(1, file_name="copy.csv", arrival="third"), LATER)
    names = ("t1", "h3-1.csv", "h3-1", "crew/new.uff", "new.uff", "copy", "copy.csv")
    assert {find_recording(store, name) for name in names} == {(test.recording_id, None)}
    assert find_recording(store, "new") == (test.recording_id, "new")
    came_as = {each.subject for each in list_events(store, recording_id=recording.id)}
    assert came_as == {"crew/new.uff", "h3-1.csv", "copy.csv"}
    with pytest.raises(NothingThere):
        find_recording(store, "h3")
    refused = store.recordings.receive(a_file(2), NOW).recording
    store.recordings.refuse(refused.id, {"message": "no rate."}, NOW)
    store.recordings.receive(a_file(2, file_name="retry.csv", arrival="again"), LATER)
    assert find_recording(store, "h3-2") == find_recording(store, "retry") == (refused.id, None)
