"""A test is done again from any stage: the same results come, and the old ones stay."""

from __future__ import annotations

import pytest

from shm.pipeline import Flow
from shm.store import Stage, Workspace
from shm.store.journal import list_former_tests
from shm.store.posteriors import list_history
from shm.store.recordings import count_stages, find_recording
from tests.helpers.comparing import assert_same
from tests.helpers.flows import a_flow, ingest, tension_kn
from tests.helpers.workspaces import write_loss


@pytest.fixture
def done(workspace: Workspace) -> Workspace:
    write_loss(workspace.spool, workspace)
    ingest(workspace)
    return workspace


def do_again(flow: Flow, name: str, stage: Stage) -> None:
    recording_id, test = find_recording(flow.store, name)
    flow.store.recordings.rerun(recording_id, stage, flow.clock(), test)
    flow.drain()


@pytest.mark.parametrize("stage", [Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED])
def test_a_test_done_again_gives_the_same_and_raises_no_second_alert(
    done: Workspace, stage: Stage
) -> None:
    with a_flow(done) as flow:
        before = tension_kn(flow.store), flow.store.watch.list_all(3)[-1].watched
        alerts = flow.store.alerts.list_all()
        do_again(flow, "t2", stage)
        assert_same((tension_kn(flow.store), flow.store.watch.list_all(3)[-1].watched), before)
        assert flow.store.alerts.list_all() == alerts
        assert count_stages(flow.store)[Stage.DONE] == 3
        rows = list_former_tests(flow.store, find_recording(flow.store, "t2")[0])
        kept = (len(rows), sum(len(row.posteriors) for row in rows))
        assert kept == {"identified": (2, 2), "updated": (1, 2), "watched": (1, 1)}[stage]


def test_the_test_of_the_baseline_done_again_leaves_the_baseline_alone(done: Workspace) -> None:
    with a_flow(done) as flow:
        before, shifts = flow.store.watch.baseline(3), flow.store.watch.list_drifts(3)
        do_again(flow, "t0", Stage.IDENTIFIED)
        after = flow.store.watch.baseline(3)
        assert before is not None
        assert after is not None
        assert after.id == before.id
        assert flow.store.watch.list_drifts(3) == shifts
        assert count_stages(flow.store)[Stage.DONE] == 3
        assert [test.test.id for test, _ in list_history(flow.store, 3)] == ["t0", "t1", "t2"]


def test_a_test_that_is_watched_while_the_baselines_own_is_done_again_is_watched_as_ever(
    done: Workspace,
) -> None:
    with a_flow(done) as flow:
        shifts = flow.store.watch.list_drifts(3)
        flow.store.recordings.rerun(
            find_recording(flow.store, "t0")[0], Stage.IDENTIFIED, flow.clock()
        )
        do_again(flow, "t2", Stage.WATCHED)
        assert flow.store.watch.list_drifts(3) == shifts


def test_a_result_of_work_that_was_sent_back_meanwhile_is_not_kept(done: Workspace) -> None:
    with a_flow(done) as flow:
        store = flow.store
        recording_id, _ = find_recording(store, "t2")
        test = store.tests.list_all(3)[-1]
        store.recordings.rerun(recording_id, Stage.UPDATED, flow.clock(), "t2")
        store.recordings.rerun(recording_id, Stage.IDENTIFIED, flow.clock())
        store.posteriors.save(test, store.posteriors.get(3, "t1"), test.lineage, flow.clock())
        (row,) = list_former_tests(store, recording_id)
        assert len(row.posteriors) == 1
