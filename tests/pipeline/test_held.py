"""What is implausible is held: it counts in nothing until a person has looked."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from shm.documents import dump
from shm.errors import NothingThere, UsageError
from shm.modes_document import modes_document
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Decision, Outcome, Stage, Store, StoredAlert, Workspace
from shm.store.backups import check_store
from shm.store.posteriors import list_history, list_posteriors, list_trend
from shm.store.recordings import (
    count_stages,
    find_oldest_waiting,
    list_holds,
)
from shm.store.tests import count_tests, list_test_rows, list_waiting_tests
from shm.values import ModalTest, Recording
from tests.helpers.contents import quiet
from tests.helpers.flows import a_flow, ingest, receive_all
from tests.helpers.hangers import HANGER_3
from tests.helpers.taken_in import copied
from tests.helpers.workspaces import START, make_workspace, modelled_test, put
from tests.helpers.written import write

EPOCH = datetime(1970, 1, 1, 0, 3, tzinfo=UTC)
QUICK_PLAN = HammerPlan(hits=3, seconds_per_hit=8.0)


def spool(
    workspace: Workspace, name: str, time: datetime | None, tension: float = 1.0
) -> ModalTest:
    test = modelled_test(name, workspace.bridge.hanger(3), tension=tension)
    test = replace(test, time=time)
    put(workspace.spool / f"{name}.modes.json", dump(modes_document([test])))
    return test


def day(number: float) -> datetime:
    return START + timedelta(days=number)


@pytest.fixture
def held(tmp_path: Path) -> Workspace:
    """A good test, then one of 1970 with a tenth less tension."""
    return copied("held without sampling", tmp_path / "bridge", _make_held)


def _make_held(folder: Path) -> None:
    workspace = make_workspace(folder, hooks={"mail": ["true"]})
    spool(workspace, "good", day(0))
    ingest(workspace)
    spool(workspace, "lost", EPOCH, tension=0.9)
    ingest(workspace)


def counted(store: Store) -> list[str]:
    return [test.test.id for test in store.tests.list_all(3)]


def test_what_is_held_counts_in_nothing(held: Workspace) -> None:
    with held.store() as store:
        assert counted(store) == ["good"]
        assert count_stages(store)[Stage.HELD] == 1
        assert store.watch.list_drifts(3) == ()
        assert [test.test.id for test, _ in list_history(store, 3)] == ["good"]
        assert [row.name for row in list_test_rows(store, 3)] == ["good"]
        assert count_tests(store)[3].tests == 1
        assert len(list_trend(store, held.bridge.hanger(3))) == 1
        assert find_oldest_waiting(store) is None
        assert list_waiting_tests(store) == ()
        with pytest.raises(NothingThere):
            store.tests.named(3, "lost")
        (hold,) = list_holds(store)
        assert (hold.recording_id, hold.hanger, hold.decision) == (2, 3, None)
        assert [doubt.check for doubt in hold.doubts] == ["clock before the bridge"]


def test_what_is_confirmed_counts_from_its_receipt_where_its_time_is_wrong(
    held: Workspace,
) -> None:
    with a_flow(held) as flow:
        at = flow.clock()
        hold = flow.store.recordings.accept(2, "Ann", "clock was dead", at)
        assert (hold.decision, hold.who, hold.why) == (Decision.CONFIRMED, "Ann", "clock was dead")
        flow.drain()
        assert flow.store.recordings.get(2).stage is Stage.DONE
        _, test = flow.store.tests.list_all(3)
        assert test.time == flow.store.recordings.get(2).received_at
        assert test.test.time is None
        assert "confirmed by Ann" in test.notes[-1]
        assert [drift.test for drift in flow.store.watch.list_drifts(3)] == ["lost"]
        assert list_holds(flow.store) == ()
        (notice,) = alerts_but_notices(flow.store)
        assert notice.acknowledgement is not None
        assert notice.acknowledgement.who == "Ann"


def test_a_confirmed_test_has_the_time_that_a_person_gave_it(held: Workspace) -> None:
    with a_flow(held) as flow:
        flow.store.recordings.accept(2, "Ann", "", flow.clock(), day(30))
        flow.drain()
        assert [test.time for test in flow.store.tests.list_all(3)] == [day(0), day(30)]
        flow.store.recordings.rerun(2, Stage.IDENTIFIED, flow.clock())
        flow.drain()
        assert [test.time for test in flow.store.tests.list_all(3)] == [day(0), day(30)]
        assert count_stages(flow.store)[Stage.HELD] == 0
        with pytest.raises(UsageError, match="not held: it was confirmed by Ann"):
            flow.store.recordings.accept(2, "Bob", "", flow.clock())


def test_what_is_discarded_ends_and_its_raw_file_stays(held: Workspace) -> None:
    with a_flow(held) as flow:
        flow.store.recordings.exclude(2, "Ann", "wrong hanger", flow.clock())
        flow.drain()
        recording = flow.store.recordings.get(2)
        assert recording.stage is Stage.REFUSED
        assert recording.reason is not None
        assert recording.reason["message"] == (
            f"discarded on {flow.clock():%Y-%m-%d} by Ann, because: wrong hanger."
        )
        assert "`shm ingest --confirm 2 --why TEXT`" in recording.reason["remedy"]
        assert held.archive.holds(recording.file)
        assert counted(flow.store) == ["good"]
        assert list_holds(flow.store) == ()


def test_what_was_discarded_and_comes_again_stays_discarded(held: Workspace) -> None:
    """It was held again, and asked again, each time that the crew sent its folder."""
    with a_flow(held) as flow:
        flow.store.recordings.exclude(2, "Ann", "of another bridge", flow.clock())
        spool(held, "lost", EPOCH, tension=0.9)
        receipt = flow.receive(held.spool / "lost.modes.json")
        flow.drain()
        assert receipt.outcome is Outcome.DISCARDED
        assert flow.store.recordings.get(2).stage is Stage.REFUSED
        assert len(flow.store.alerts.list_all()) == 1
        assert list(held.spool.iterdir()) == []
        with pytest.raises(UsageError, match=r"was discarded on .* because: of another bridge"):
            flow.store.recordings.rerun(2, Stage.IDENTIFIED, flow.clock())


def test_what_was_discarded_is_taken_back_with_its_true_time(held: Workspace) -> None:
    with a_flow(held) as flow:
        flow.store.recordings.exclude(2, "Ann", "", flow.clock())
        hold = flow.store.recordings.accept(2, "Bob", "it was right", flow.clock(), day(30))
        flow.drain()
        assert (hold.decision, hold.who) == (Decision.REINSTATED, "Bob")
        recording = flow.store.recordings.get(2)
        assert (recording.stage, recording.reason) == (Stage.DONE, None)
        assert [test.time for test in flow.store.tests.list_all(3)] == [day(0), day(30)]
        assert [drift.test for drift in flow.store.watch.list_drifts(3)] == ["lost"]
        flow.store.recordings.rerun(2, Stage.IDENTIFIED, flow.clock())
        flow.drain()
        assert [test.time for test in flow.store.tests.list_all(3)] == [day(0), day(30)]
        assert check_store(flow.store, quiet).troubles == ()


@pytest.fixture
def counting(workspace: Workspace) -> Workspace:
    """Three good tests and two of a loss, twenty days apart: recordings 1 to 5."""
    for number, tension in enumerate((1.0, 1.0, 1.0, 0.8, 0.8)):
        spool(workspace, f"t{number}", day(20 * number), tension)
        ingest(workspace)
    return workspace


def test_what_counts_is_taken_out_and_back_again(counting: Workspace) -> None:
    """Nobody could take out the part that had come before its whole."""
    with a_flow(counting) as flow:
        store = flow.store
        made = store.recordings.exclude(4, "Ann", "of hanger 4", flow.clock())
        assert (made.hold.decision, made.of_baseline, made.watched_again) == (
            Decision.WITHDRAWN,
            (),
            1,
        )
        flow.drain()
        assert counted(store) == ["t0", "t1", "t2", "t4"]
        assert [watch.watched.test for watch in store.watch.list_all(3)] == ["t1", "t2", "t4"]
        assert [watch.watched.change.called for watch in store.watch.list_all(3)] == [False] * 3
        assert {drift.test for drift in store.watch.list_drifts(3)} == {"t1", "t2", "t4"}
        assert [test.test.id for test, _ in list_history(store, 3)] == ["t0", "t1", "t2", "t4"]
        assert (
            len(list_posteriors(store, 3)) == len(list_trend(store, counting.bridge.hanger(3))) == 4
        )
        with pytest.raises(NothingThere):
            store.posteriors.get(3, "t3")
        recording = store.recordings.get(4)
        assert (recording.stage, counting.archive.holds(recording.file)) == (Stage.REFUSED, True)
        assert check_store(store, quiet).troubles == ()
        with pytest.raises(UsageError, match="does not count: it was discarded"):
            store.recordings.exclude(4, "Ann", "", flow.clock())
        store.recordings.accept(4, "Ann", "it was of 3", flow.clock())
        flow.drain()
        assert counted(store) == ["t0", "t1", "t2", "t3", "t4"]
        assert [watch.watched.change.called for watch in store.watch.list_all(3)] == [
            False,
            False,
            False,
            True,
        ]
        assert check_store(store, quiet).troubles == ()
        with pytest.raises(UsageError, match="nothing of recording 4 is held or discarded"):
            store.recordings.accept(4, "Ann", "", flow.clock())


def test_one_test_of_a_campaign_is_taken_out_and_stays_out(workspace: Workspace) -> None:
    tests = [modelled_test(name, workspace.bridge.hanger(3), n) for n, name in enumerate("abc")]
    document = dump(modes_document(tests))
    put(workspace.spool / "campaign.modes.json", document)
    ingest(workspace)
    with a_flow(workspace) as flow:
        store = flow.store
        store.recordings.exclude(1, "Ann", "a slip", flow.clock(), "b")
        flow.drain()
        assert (counted(store), store.recordings.get(1).stage) == (["a", "c"], Stage.DONE)
        store.recordings.rerun(1, Stage.IDENTIFIED, flow.clock())
        flow.drain()
        assert counted(store) == ["a", "c"]
        assert check_store(store, quiet).troubles == ()
        store.recordings.accept(1, "Ann", "no slip", flow.clock(), test="b")
        flow.drain()
        assert counted(store) == ["a", "b", "c"]
        assert check_store(store, quiet).troubles == ()


@pytest.mark.slow
def test_the_whole_counts_in_place_of_its_part(workspace: Workspace) -> None:
    """The whole that came after a part of it was called the copy, and could not count alone."""
    whole = a_recording()
    cut = [replace(c, values=c.values[: len(c.values) * 2 // 3]) for c in whole.channels]
    write(replace(whole, channels=tuple(cut)), workspace.spool / "part.npz")
    ingest(workspace)
    write(whole, workspace.spool / "whole.npz")
    ingest(workspace)
    with a_flow(workspace) as flow:
        (hold,) = list_holds(flow.store)
        assert "it holds part.npz (recording 1)" in hold.message
        assert (
            "`shm ingest --discard 1 --why TEXT`, then `shm ingest --confirm 2 --why TEXT`"
            in hold.message
        )
        assert ".." not in hold.message
        flow.store.recordings.exclude(1, "Ann", "a part", flow.clock())
        flow.store.recordings.accept(2, "Ann", "the whole", flow.clock())
        flow.drain()
        assert counted(flow.store) == ["whole"]
        write(replace(whole, channels=tuple(cut[::-1])), workspace.spool / "again.npz")
        receive_all(flow)
        flow.drain()
        (hold,) = list_holds(flow.store)
        assert "a part of whole.npz (recording 2), sent again" in hold.message


def test_the_other_tests_of_a_file_go_on(workspace: Workspace) -> None:
    tests = [
        replace(modelled_test(name, workspace.bridge.hanger(3)), time=time)
        for name, time in (("a", day(0)), ("b", EPOCH), ("c", day(30)))
    ]
    put(workspace.spool / "campaign.modes.json", dump(modes_document(tests)))
    with a_flow(workspace) as flow:
        receive_all(flow)
        flow.drain()
        assert counted(flow.store) == ["a", "c"]
        assert [drift.test for drift in flow.store.watch.list_drifts(3)] == ["c"]
        assert flow.store.recordings.get(1).stage is Stage.HELD
        flow.store.recordings.accept(1, "Ann", "", flow.clock())
        flow.drain()
        assert flow.store.recordings.get(1).stage is Stage.DONE
        assert counted(flow.store) == ["a", "c", "b"]


def test_a_held_test_that_is_killed_on_the_way_is_told_of_once(workspace: Workspace) -> None:
    spool(workspace, "first", EPOCH)
    with a_flow(workspace) as flow:
        receive_all(flow)
    for _ in range(3):  # each time a process of its own
        ingest(workspace)
    with workspace.store() as store:
        assert len(store.alerts.list_all()) == len(list_holds(store)) == 1


@cache
def a_recording(seed: int = 1) -> Recording:
    state = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)
    rng = np.random.default_rng(seed)
    return hammer_test(HANGER_3, state, QUICK_PLAN, rng, time=day(0), source="s")


def test_a_corrected_sidecar_ends_a_hold(workspace: Workspace) -> None:
    write(replace(a_recording(), time=EPOCH), workspace.spool / "a.uff")
    raw = (workspace.spool / "a.uff").read_bytes()
    sidecar = (workspace.spool / "a.toml").read_text()
    ingest(workspace)
    with workspace.store() as store:
        assert count_stages(store)[Stage.HELD] == 1
    put(workspace.spool / "a.toml", sidecar.replace("1970-01-01", "2026-05-09"))
    put(workspace.spool / "a.uff", raw)
    ingest(workspace)
    with workspace.store() as store:
        assert list_holds(store) == ()
        assert store.recordings.get(1).stage is Stage.DONE
        (notice,) = store.alerts.list_all()
        assert notice.acknowledgement is not None


def alerts_but_notices(store: Store) -> list[StoredAlert]:
    """Without those that ask to repeat a test that agrees with none before it."""
    return [each for each in store.alerts.list_all() if each.alert.kinds != ("repeat the test",)]
