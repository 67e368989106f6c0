"""Files go through all stages, in the right order, once, whatever happens on the way."""

from __future__ import annotations

import json
import logging
import pkgutil
import sqlite3
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shm.documents import dump
from shm.errors import ShmError, StoreBusy, WorkerDied
from shm.modes_document import modes_document
from shm.pipeline import Flow, steps
from shm.read import Limits
from shm.store import DeliveryState, Stage, Workspace
from shm.store.posteriors import list_history
from shm.store.recordings import list_recordings
from shm.store.tests import Tests
from shm.store.watch import find_latest_watches
from shm.values import ModalTest, Posterior
from tests.helpers import quick_update
from tests.helpers.flows import Clock, Postman, a_flow, ingest, receive_all, tension_kn
from tests.helpers.taken_in import copied
from tests.helpers.workspaces import (
    START,
    make_workspace,
    put,
    write_loss,
    write_slow_loss,
    write_test,
)


def spool(workspace: Workspace, name: str, **values: float) -> None:
    write_test(workspace.spool / f"{name}.modes.json", workspace, **values)  # type: ignore[arg-type]


def stages(workspace: Workspace) -> dict[str, Stage]:
    with workspace.store() as store:
        return {recording.file.file_name: recording.stage for recording in list_recordings(store)}


@pytest.mark.usefixtures("real_sampler")
def test_files_go_from_the_spool_through_all_stages(workspace: Workspace) -> None:
    spool(workspace, "t1", day=0)
    spool(workspace, "t2", day=1, tension=1.01)
    ingest(workspace)
    assert list(workspace.spool.iterdir()) == []
    assert set(stages(workspace).values()) == {Stage.DONE}
    with workspace.store() as store:
        tensions = tension_kn(store)
        assert tensions["t1"] == pytest.approx(711, rel=0.01)
        assert tensions["t2"] == pytest.approx(711 * 1.01, rel=0.01)
        assert [drift.test for drift in store.watch.list_drifts(3)] == ["t2"]
        (drift,) = store.watch.list_drifts(3)
        assert drift.baseline == pytest.approx(711e3, rel=0.01)
        # A percent in one test is no change yet.
        assert 0 <= drift.shift_mean < 0.01
        assert drift.shift_sd > 0
        assert store.alerts.list_all() == ()
        assert store.watch.baseline(3) is not None


def test_tests_are_watched_in_the_order_of_their_times(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three tests show a loss, the first is slow to update: the second in time tells it still."""
    spool(workspace, "t0", day=0)
    ingest(workspace)
    quick, done = steps.refresh, threading.Event()

    def refresh(tests: Any, model: Any, known: Any, options: Any) -> Posterior:
        if tests[0].id == "t1":
            assert done.wait(20)
            time.sleep(0.1)
        done.set()
        return quick(tests, model, known, options)

    monkeypatch.setattr(steps, "refresh", refresh)
    for number in (1, 2, 3):
        spool(workspace, f"t{number}", day=30 + number, tension=0.8)
    ingest(workspace, lanes=3)
    with workspace.store() as store:
        assert [drift.test for drift in store.watch.list_drifts(3)] == ["t1", "t2", "t3"]
        assert [(each.alert.test, each.alert.kinds) for each in store.alerts.list_all()] == [
            ("t1", ("repeat the test",)),
            ("t2", ("beyond threshold",)),
        ]


def test_a_lost_tension_is_told_once_to_each_hook_and_names_the_test_that_calls_it(
    workspace: Workspace,
) -> None:
    write_loss(workspace.spool, workspace, lost=3)
    postman = Postman()
    ingest(workspace, notifier=postman, lanes=3)
    with workspace.store() as store:
        stored = [each.alert for each in store.alerts.list_all()]
        assert [each.key for each in stored] == [
            "hanger-3:repeat-the-test:t1:baseline-1",
            "hanger-3:two-tests-agree:tension-down:t2:baseline-1",
        ]
        assert [each.test for each in stored] == ["t1", "t2"]
        notice, loss = (each.key for each in stored)
        assert postman.told == [("mail", key) for key in (notice, f"{notice}:resolved", loss)]
        assert {each.state for each in store.alerts.list_deliveries()} == {DeliveryState.DELIVERED}
        assert len(store.watch.list_drifts(3)) == 3


@pytest.fixture
def untold(tmp_path: Path) -> Workspace:
    """A slow loss was taken in by a flow without a notifier: its one alert waits for `mail`."""
    return copied("slow loss, untold", tmp_path / "lost", _take_in_untold)


def _take_in_untold(folder: Path) -> None:
    workspace = make_workspace(
        folder,
        hooks={"mail": ["true"]},
        settings={"hook_attempts": 3, "hook_backoff_seconds": 10.0},
    )
    write_slow_loss(workspace.spool, workspace)
    ingest(workspace)


def test_a_hook_that_fails_is_tried_again_ever_later_and_then_given_up(untold: Workspace) -> None:
    clock, postman, waits = Clock(), Postman(failures=99), []
    with a_flow(untold, clock=clock, notifier=postman) as flow:
        flow.drain()
        while waiting := flow.store.alerts.list_deliveries(DeliveryState.WAITING):
            waits.append((waiting[0].next_attempt_at - clock()).total_seconds())
            clock.pass_by(waits[-1])
            flow.drain()
        (delivery,) = flow.store.alerts.list_deliveries()
    assert waits == [10.0, 20.0]
    assert (delivery.state, delivery.attempts) == (DeliveryState.GIVEN_UP, 3)
    assert delivery.last_error == "no answer"
    assert set(stages(untold).values()) == {Stage.DONE}


def test_results_do_not_depend_on_order_or_executor(tmp_path: Path) -> None:
    found = []
    for label, names, lanes in (("one", "abc", 1), ("many", "cab", 3)):
        workspace = make_workspace(tmp_path / label)
        spool(workspace, "0", day=-1)
        ingest(workspace)
        with a_flow(workspace, lanes=lanes) as flow:
            for name in names:
                spool(workspace, name, day=ord(name), tension=1 + ord(name) / 1e4)
                flow.receive(workspace.spool / f"{name}.modes.json")
                if lanes == 1:
                    flow.drain()
            flow.drain()
            history = list_history(flow.store, 3)
            found.append({test.test.id: posterior.samples for test, posterior in history})
    assert found[0].keys() == found[1].keys() == {"0", "a", "b", "c"}
    for name, samples in found[0].items():
        np.testing.assert_array_equal(samples, found[1][name])


@pytest.mark.slow
def test_a_flow_ended_after_any_turn_goes_on_where_it_stood(workspace: Workspace) -> None:
    """As by `kill -9`: each flow takes few turns, what it had under way is lost with it."""
    write_loss(workspace.spool, workspace)
    reference = make_workspace(workspace.folder.with_name("reference"))
    for path in workspace.spool.iterdir():
        put(reference.spool / path.name, path.read_bytes())
    ingest(reference)
    for turns in (1, 2, 2, 3, 2, 4, 2, 3, 2, 2, 2, 2):
        with a_flow(workspace) as flow, ThreadPoolExecutor(1) as threads:
            flow.executor = threads
            receive_all(flow)
            for _ in range(turns):
                flow.advance()
    ingest(workspace)
    assert stages(workspace) == stages(reference)
    with workspace.store() as store, reference.store() as expected:
        assert tension_kn(store) == tension_kn(expected)
        assert store.watch.list_drifts() == expected.watch.list_drifts()
        assert [a.alert for a in store.alerts.list_all()] == [
            a.alert for a in expected.alerts.list_all()
        ]
        assert [a.alert.test for a in store.alerts.list_all()] == ["t1", "t2"]


def test_a_fault_of_ours_refuses_the_file_and_the_rest_goes_on(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    refresh = steps.refresh

    def fail_on_t2(tests, model, known, options):  # type: ignore[no-untyped-def]
        if tests[0].id == "t2":
            raise ZeroDivisionError("division by zero")
        return refresh(tests, model, known, options)

    monkeypatch.setattr(steps, "refresh", fail_on_t2)
    for day in (1, 2, 3):
        spool(workspace, f"t{day}", day=day)
    ingest(workspace)
    assert list(stages(workspace).values()) == [Stage.DONE, Stage.REFUSED, Stage.DONE]
    reason = json.loads((workspace.folder / "quarantine/t2.modes.json.reason.json").read_text())
    assert "internal error: ZeroDivisionError" in reason["message"]
    assert any(record.exc_info for record in caplog.records)
    with workspace.store() as store:
        assert list(tension_kn(store)) == ["t1", "t3"]
        (refused,) = list_recordings(store, Stage.REFUSED)
        assert workspace.archive.holds(refused.file)


@pytest.mark.parametrize(
    "error",
    [ShmError("not now.", retry_after_s=30.0), ModuleNotFoundError("No module named 'scipy'")],
)
@pytest.mark.parametrize("later_s", [61, -86400])
def test_passing_trouble_is_waited_out_and_holds_up_nobody(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, error: Exception, later_s: float
) -> None:
    """Also where the clock was a day ahead meanwhile; an upgrade under way is such trouble."""
    read_modes, trouble = steps.load_modes, [True]

    def fail_once(path, limits):  # type: ignore[no-untyped-def]
        if path.name.startswith("a") and trouble.pop():
            raise error
        return read_modes(path, limits)

    monkeypatch.setattr(steps, "load_modes", fail_once)
    trouble[:] = [False, True]
    spool(workspace, "a", day=2)
    spool(workspace, "b", day=1)
    clock = Clock()
    with a_flow(workspace, clock=clock) as flow:
        receive_all(flow)
        flow.drain()
        assert list(stages(workspace).values()) == [Stage.RECEIVED, Stage.DONE]
        clock.pass_by(later_s)
        flow.drain()
    assert set(stages(workspace).values()) == {Stage.DONE}


class DyingPool(ThreadPoolExecutor):
    """Its workers die, all that are at work, when they meet a file of this name."""

    def __init__(self, name: str):
        super().__init__(2)
        self.name = name
        self.at_work: list[str] = []
        self.beside: list[int] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        step, subject = fn.args[:2]
        file_name = subject.file.file_name if step is steps.identify_file else ""
        return super().submit(self._work, fn, file_name)

    def _work(self, fn: Any, file_name: str) -> Any:
        self.at_work.append(file_name)
        time.sleep(0.05)  # so that both workers are met at work
        try:
            if file_name.startswith(self.name):
                self.beside.append(len(self.at_work) - 1)
                raise BrokenProcessPool("a worker died")
            return fn()
        finally:
            self.at_work.remove(file_name)


def drain_patiently(flow: Flow, clock: Clock, most: int = 50) -> list[float]:
    """Works on, each pause at once, until nothing is to be tried again; the pauses in seconds."""
    pauses = []
    flow.drain()
    while (due_s := flow.suspects_due_s()) is not None and len(pauses) < most:
        pauses.append(due_s)
        clock.pass_by(due_s)
        flow.drain()
    return pauses


def test_a_file_that_kills_its_worker_is_tried_again_alone_and_then_refused(
    workspace: Workspace, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    for number, name in enumerate(("bad", "good", "other")):
        spool(workspace, name, day=number)
    clock = Clock()
    with (
        DyingPool("bad") as pool,
        a_flow(workspace, executor=pool, lanes=2, clock=clock) as flow,
    ):
        receive_all(flow)
        assert drain_patiently(flow, clock) == [2.0, 8.0, 32.0, 128.0, 512.0]
    assert pool.beside == [1, 0, 0, 0, 0, 0]
    assert list(stages(workspace).values()) == [Stage.REFUSED, Stage.DONE, Stage.DONE]
    reason = json.loads((workspace.folder / "quarantine/bad.modes.json.reason.json").read_text())
    assert reason["message"] == "the process that worked on it died; so it went 6 times in a row."
    assert "export it again" in reason["remedy"]


class Killed(ThreadPoolExecutor):
    """A worker that is killed from outside while it works on some files, so many times."""

    def __init__(self, times: int, names: Sequence[str] = ("",), **how: Any):
        super().__init__(2)
        self.left = dict.fromkeys(names, times)
        self.error = WorkerDied("it was killed (SIGKILL).", **how)

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        return super().submit(self._work, fn)

    def _work(self, fn: Any) -> Any:
        step, subject = fn.args[:2]
        file_name = subject.file.file_name if step is steps.identify_file else "-"
        for name, left in self.left.items():
            if left and file_name.startswith(name):
                self.left[name] -= 1
                raise self.error
        return fn()


def test_deaths_and_pauses_outlast_the_daemon(workspace: Workspace) -> None:
    """Each daemon lives for one kill; one that begins within the pause waits for its end."""
    spool(workspace, "bad")
    clock, pauses = Clock(), []
    for _ in range(6):
        with Killed(1) as pool, a_flow(workspace, executor=pool, clock=clock) as flow:
            receive_all(flow)
            flow.drain()
            assert pool.left == {"": 0}
            pauses.append(flow.suspects_due_s())
        clock.pass_by((pauses[-1] or 0.0) / 2)
        with Killed(1) as pool, a_flow(workspace, executor=pool, clock=clock) as flow:
            flow.drain()
            assert pool.left == {"": 1}
        clock.pass_by((pauses[-1] or 0.0) / 2)
    assert set(stages(workspace).values()) == {Stage.REFUSED}
    assert pauses == [2.0, 8.0, 32.0, 128.0, 512.0, None]


def test_a_result_is_not_lost_while_the_store_is_busy(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    spool(workspace, "t1")
    keep, busy = Tests.save, [True]

    def busy_once(self, *args):  # type: ignore[no-untyped-def]
        if busy and busy.pop():
            raise StoreBusy("held", retry_after_s=1.0)
        keep(self, *args)

    load, loaded = steps.load_modes, list[Path]()

    def count(path: Path, limits: Limits) -> tuple[ModalTest, ...]:
        loaded.append(path)
        return load(path, limits)

    monkeypatch.setattr(steps, "load_modes", count)
    monkeypatch.setattr(Tests, "save", busy_once)
    with a_flow(workspace) as flow:
        receive_all(flow)
        with pytest.raises(StoreBusy):
            flow.drain()
        flow.drain()
    assert set(stages(workspace).values()) == {Stage.DONE}
    assert len(loaded) == 1  # what was computed is not computed again


@pytest.mark.parametrize(
    ("place", "error"),
    [
        ("shm.pipeline.work.judge", KeyError("tension")),
        ("shm.pipeline.work.reconciled", ValueError("The truth value of an array is ambiguous")),
        ("shm.store.posteriors.Posteriors.save", TypeError("not a number")),
    ],
)
def test_advance_storing_raises(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, place: str, error: Exception
) -> None:
    """Only the file whose result cannot be stored is refused; every other file is done."""
    spool(workspace, "t1", day=1)
    ingest(workspace)
    original, failures = pkgutil.resolve_name(place), [error]

    def fail_once(*args: Any, **values: Any) -> Any:
        if failures:
            raise failures.pop()
        return original(*args, **values)

    monkeypatch.setattr(place, fail_once)
    for day in (2, 3, 4):
        spool(workspace, f"t{day}", day=day)
    ingest(workspace)
    assert list(stages(workspace).values()) == [Stage.DONE, Stage.REFUSED, Stage.DONE, Stage.DONE]
    reason = json.loads((workspace.folder / "quarantine/t2.modes.json.reason.json").read_text())
    assert repr(error) in reason["message"]


def test_a_refused_test_does_not_stop_the_others_of_its_file(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    refresh = steps.refresh

    def fail_on_second(tests, model, known, options):  # type: ignore[no-untyped-def]
        if tests[0].id == "second":
            raise ShmError("will not.", remedy="Leave it out.")
        return refresh(tests, model, known, options)

    monkeypatch.setattr(steps, "refresh", fail_on_second)
    test = write_test(workspace.spool / "x.modes.json", workspace)
    tests = [
        replace(test, id=name, time=START + timedelta(days=day))
        for day, name in enumerate(("first", "second", "third"))
    ]
    put(workspace.spool / "x.modes.json", dump(modes_document(tests)))
    ingest(workspace)
    assert set(stages(workspace).values()) == {Stage.REFUSED}
    with workspace.store() as store:
        assert list(tension_kn(store)) == ["first", "third"]
        assert [drift.test for drift in store.watch.list_drifts(3)] == ["third"]


def test_documents_that_cannot_be_read_stop_their_hanger_and_not_the_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    quick_update.stand_in(monkeypatch.setattr)
    bridge = make_workspace(tmp_path / "bridge", hangers=(3, 4), hooks={"mail": ["true"]})
    for hanger in (3, 4):
        for day, tension in ((0, 1.0), (30, 1.0), (60, 0.8), (61, 0.8)):
            path = bridge.spool / f"h{hanger}-{day}.modes.json"
            write_test(path, bridge, hanger=hanger, day=day, tension=tension)
    with a_flow(bridge, notifier=Postman()) as flow:
        receive_all(flow)
        flow.drain()
        assert {each.alert.hanger for each in flow.store.alerts.list_all()} == {3, 4}
    with sqlite3.connect(bridge.database) as connection:
        for table in ("alerts", "watches", "posteriors", "tests"):
            connection.execute(f"UPDATE {table} SET document = 'no' WHERE hanger = 3")
    connection.close()
    for hanger in (3, 4):
        path = bridge.spool / f"h{hanger}-90.modes.json"
        write_test(path, bridge, hanger=hanger, day=90, tension=0.8)
    with a_flow(bridge, notifier=Postman()) as flow:  # thresholds and limits read each hanger's
        bridge.change_setting(flow.store, "settings.false_call_years", 50.0, flow.clock(), "Meier")
        flow.use(bridge.reopened())
        receive_all(flow)
        flow.drain()
        assert flow.store.tests.named(4, "h4-90").stage is Stage.WATCHED
        assert find_latest_watches(flow.store, [bridge.bridge.hanger(4)])[4].watched.test == "h4-90"
    assert "hanger 3 cannot be judged again" in caplog.text


def test_healthy_files_whose_workers_are_killed_by_turns_are_done(workspace: Workspace) -> None:
    """As 18 of 20 were refused, when an operator or the kernel killed each worker twice."""
    names = [f"t{number}." for number in range(6)]
    for day, name in enumerate(names):
        spool(workspace, name.rstrip("."), day=day)
    clock = Clock()
    with Killed(5, names) as pool, a_flow(workspace, executor=pool, clock=clock) as flow:
        receive_all(flow)
        drain_patiently(flow, clock, most=1000)
    assert set(stages(workspace).values()) == {Stage.DONE}
