"""Doing work again: what it replaces stays with its lineage, and nothing shows it by mistake."""

from __future__ import annotations

from datetime import timedelta

import pytest

from shm.errors import NothingThere, UsageError
from shm.store import Baseline, IdentifiedTest, Lineage, Stage, Store, StoredTest, WatchCheckpoint
from shm.store.journal import list_events, list_former_tests
from shm.store.posteriors import list_history, list_posteriors
from shm.store.recordings import find_recording
from shm.store.tests import list_baseline_tests, list_waiting_tests
from shm.values import Selection
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test, a_watched_test

OLD, NEW = Lineage("0" * 64, "1" * 64, "0.1.0"), Lineage("0" * 64, "1" * 64, "0.2.0")
LATER = NOW + timedelta(days=400)


def identified(store: Store, number: int, lineage: Lineage = OLD, name: str = "") -> StoredTest:
    recording = store.recordings.receive(a_file(number), NOW).recording
    item = IdentifiedTest(a_test(name or f"t{number}", days=number))
    store.tests.save(recording.id, [item], lineage, NOW)
    return next(test for test in store.tests.list_all() if test.recording_id == recording.id)


def with_baseline(store: Store) -> Baseline:
    first = identified(store, 1)
    store.posteriors.save_selection(3, [first], Selection((a_posterior(),), (1.0,)), OLD, NOW)
    baseline = store.watch.baseline(3)
    assert baseline is not None
    return baseline


def watched(store: Store, test: StoredTest, baseline: Baseline, seed: int = 1) -> None:
    name = test.test.id
    lineage = OLD if seed == 1 else NEW
    store.posteriors.save(test, a_posterior("beam1", (name,), seed=seed), lineage, NOW)
    state = WatchCheckpoint("a key", test.time, b"state")
    store.watch.save(test, baseline, a_watched_test(name), None, [], NOW, state)


def test_identifying_again_keeps_the_old_result_beside_the_new_one(store: Store) -> None:
    baseline = with_baseline(store)
    second = identified(store, 2)
    watched(store, second, baseline)
    rerun = store.recordings.rerun(second.recording_id, Stage.IDENTIFIED, LATER)
    assert (rerun.tests, rerun.posteriors, rerun.watches, rerun.of_baseline) == (("t2",), 1, 1, ())
    assert rerun.recording.stage is Stage.RECEIVED
    assert [test.test.id for test in store.tests.list_all(3)] == ["t1"]
    assert list_waiting_tests(store) == ()
    assert [test.test.id for test, _ in list_history(store, 3)] == ["t1"]
    assert (store.watch.list_drifts(3), store.watch.list_all(3)) == ((), ())

    again = identified(store, 2, NEW)
    assert again.test.id == "t2"
    assert again.id != second.id
    watched(store, again, baseline, seed=2)
    former, present = list_former_tests(store, again.recording_id)
    assert (former.superseded_at, present.superseded_at) == (LATER, None)
    assert (former.lineage, present.lineage) == (OLD, NEW)
    assert [made.superseded_at for made in former.posteriors] == [LATER]
    assert [made.lineage.version for made in present.posteriors] == ["0.2.0"]
    assert store.posteriors.get(3, "t2").seed == 2
    assert len(list_posteriors(store, 3)) == 2
    assert [drift.test for drift in store.watch.list_drifts(3)] == ["t2"]
    assert list_events(store, "again")[0].recording_id == second.recording_id


@pytest.mark.parametrize(
    ("stage", "stands", "posteriors"),
    [(Stage.UPDATED, Stage.IDENTIFIED, 1), (Stage.WATCHED, Stage.UPDATED, 0)],
)
def test_a_test_is_sent_back_to_the_stage_before(
    store: Store, stage: Stage, stands: Stage, posteriors: int
) -> None:
    baseline = with_baseline(store)
    second = identified(store, 2)
    watched(store, second, baseline)
    rerun = store.recordings.rerun(second.recording_id, stage, LATER, "t2")
    assert (rerun.posteriors, rerun.watches) == (posteriors, 1)
    assert store.tests.get(second.id).stage is stands
    assert rerun.recording.stage is stands
    assert [test.id for test in list_waiting_tests(store)] == [second.id]
    if stage is Stage.UPDATED:
        store.posteriors.save(second, a_posterior("beam1", ("t2",), seed=2), NEW, LATER)
    store.watch.save(second, baseline, a_watched_test("t2"), None, [], LATER)
    assert len(store.watch.list_all(3)) == len(store.watch.list_drifts(3)) == 1
    assert store.recordings.get(second.recording_id).stage is Stage.DONE


def test_the_baseline_stays_when_its_own_test_is_identified_again(store: Store) -> None:
    baseline = with_baseline(store)
    first = store.tests.list_all(3)[0]
    rerun = store.recordings.rerun(first.recording_id, Stage.IDENTIFIED, LATER)
    assert (rerun.of_baseline, rerun.posteriors) == (("t1",), 0)
    anew = identified(store, 1, NEW)
    store.posteriors.save(anew, a_posterior(seed=2), NEW, LATER, to_watch=False)
    assert store.tests.get(anew.id).stage is Stage.WATCHED
    kept = store.watch.baseline(3)
    assert kept is not None
    assert kept.id == baseline.id
    assert [test.id for test in list_baseline_tests(store, kept)] == [first.id]
    assert [posterior.seed for _, posterior in list_history(store, 3)] == [2]


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
