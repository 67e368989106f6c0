"""The loop in this process: what it takes, what it waits out, when it ends."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest

from shm.errors import ShmError, StoreBusy, StoreError
from shm.pipeline import Flow, utc_now
from shm.pipeline.streaming import Streaming
from shm.settings import Settings
from shm.store import Archive, Stage, Workspace
from shm.store.backups import check_store
from shm.store.journal import list_events
from shm.store.recordings import Recordings, count_stages
from shm_daemon import Wakeup, run
from shm_daemon.heartbeat import why_turn_failed
from tests.helpers import quick_update
from tests.helpers.flows import threads as make_threads
from tests.helpers.waiting import until
from tests.helpers.workspaces import put, write_test


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    quick_update.stand_in(monkeypatch.setattr)


@pytest.fixture
def serve(workspace: Workspace) -> Iterator[Callable[..., Wakeup]]:
    """Begins a daemon in a thread; it is stopped at the end."""
    wakeups, threads = [], []

    def begin(where: Workspace = workspace, **options: object) -> Wakeup:
        wakeup = Wakeup()
        options = {"make_executor": make_threads, "wakeup": wakeup, **options}
        thread = threading.Thread(target=run, args=(where,), kwargs=options)
        wakeups.append(wakeup)
        threads.append(thread)
        thread.start()
        return wakeup

    yield begin
    for wakeup in wakeups:
        wakeup.stop()
    for thread in threads:
        thread.join(120)
        assert not thread.is_alive()


def run_once(workspace: Workspace, **options: object) -> None:
    run(workspace, once=True, **{"make_executor": make_threads, **options})  # type: ignore[arg-type]


def counts(workspace: Workspace) -> dict[Stage, int]:
    with workspace.store() as store:
        return {stage: count for stage, count in count_stages(store).items() if count}


def test_files_dropped_while_it_runs_are_done(
    workspace: Workspace, serve: Callable[..., Wakeup]
) -> None:
    serve()
    for day in range(3):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
    until(lambda: counts(workspace) == {Stage.DONE: 3})
    assert list(workspace.spool.iterdir()) == []


def test_once_takes_everything_with_its_subfolders_and_ends(workspace: Workspace) -> None:
    (workspace.spool / "logger").mkdir()
    write_test(workspace.spool / "logger" / "a.modes.json", workspace)
    put(workspace.spool / "empty.csv", "")
    run_once(workspace)
    assert counts(workspace) == {Stage.DONE: 1, Stage.REFUSED: 1}
    assert list(workspace.spool.rglob("*")) == [workspace.spool / "logger"]


def test_nothing_is_taken_while_a_folder_is_on_another_disk(
    workspace: Workspace, serve: Callable[..., Wakeup], monkeypatch: pytest.MonkeyPatch
) -> None:
    wakeup = serve()
    write_test(workspace.spool / "a.modes.json", workspace)
    until(lambda: counts(workspace) == {Stage.DONE: 1})
    monkeypatch.setattr("shm_daemon.loop._UNREADABLE_S", 0.2)
    away = workspace.archive.folder.rename(workspace.folder / "away")
    write_test(workspace.spool / "b.modes.json", workspace, day=30)
    until(lambda: "archive/ is gone" in why_turn_failed(workspace))
    for _ in range(20):  # a turn without a scan, as after a step, says nothing of the spool
        wakeup.ring()
        time.sleep(0.02)
        assert "archive/ is gone" in why_turn_failed(workspace)
    assert not workspace.archive.folder.exists()
    assert [path.name for path in workspace.spool.iterdir()] == ["b.modes.json"]
    away.rename(workspace.archive.folder)
    until(lambda: counts(workspace) == {Stage.DONE: 2})
    assert why_turn_failed(workspace) == ""


def test_turn_streams_raise(
    workspace: Workspace, serve: Callable[..., Wakeup], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files are done although no stream can be brought forward."""

    def fail(*_: object, **__: object) -> None:
        raise ValueError("no stream")

    monkeypatch.setattr(Streaming, "advance", fail)
    write_test(workspace.spool / "a.modes.json", workspace)
    serve()
    until(lambda: counts(workspace) == {Stage.DONE: 1}, 60.0)
    assert "no stream" in why_turn_failed(workspace)


def test_two_daemons_do_not_serve_one_workspace(
    workspace: Workspace, serve: Callable[..., Wakeup], caplog: pytest.LogCaptureFixture
) -> None:
    serve()
    until(lambda: "watching" in caplog.text)
    with pytest.raises(StoreBusy, match="already ingests"):
        run_once(workspace)


def test_a_changed_description_is_taken_over(
    workspace: Workspace, serve: Callable[..., Wakeup], caplog: pytest.LogCaptureFixture
) -> None:
    serve()
    write_test(workspace.spool / "a.modes.json", workspace, hanger=4)
    until(lambda: counts(workspace) == {Stage.REFUSED: 1})
    description = workspace.folder / "bridge.toml"
    good = description.read_text()
    description.write_text("not toml")
    until(lambda: "is not taken over" in caplog.text)
    description.write_text(good.replace("id = 3", "id = 4"))
    until(lambda: "has changed and is taken over" in caplog.text)
    write_test(workspace.spool / "a.modes.json", workspace, hanger=4)
    until(lambda: counts(workspace) == {Stage.DONE: 1})


def test_a_file_that_cannot_be_taken_holds_up_nobody(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    receive, seen = Flow.receive, []

    def fail_on_a(self: Flow, path: Path) -> object:
        seen.append(path.name)
        if path.name.startswith("a") and seen.count(path.name) == 1:
            raise ShmError("changed while it was read.", retry_after_s=0.2)
        if path.name.startswith("b") and seen.count(path.name) == 1:
            raise FileNotFoundError(path)
        return receive(self, path)

    monkeypatch.setattr(Flow, "receive", fail_on_a)
    monkeypatch.setattr("shm_daemon.loop._UNREADABLE_S", 0.2)
    for name in "abc":
        write_test(workspace.spool / f"{name}.modes.json", workspace, day=ord(name))
    run_once(workspace)
    assert seen.index("c.modes.json") < seen.index("a.modes.json", 1)
    assert counts(workspace) == {Stage.DONE: 3}


def test_a_store_that_cannot_be_used_for_now_is_waited_for(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    keep, full = Archive.keep, [True, True]

    def full_twice(self: Archive, source: Path, **options: bool) -> object:
        if full:
            full.pop()
            raise StoreError("the disk is full.", remedy="Free some.", retry_after_s=0.1)
        return keep(self, source, **options)

    monkeypatch.setattr(Archive, "keep", full_twice)
    write_test(workspace.spool / "a.modes.json", workspace)
    run_once(workspace)
    assert caplog.text.count("the disk is full. Free some.") == 2
    assert counts(workspace) == {Stage.DONE: 1}


def test_a_store_that_waiting_cannot_mend_ends_the_daemon(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(self: Recordings, *args: object) -> None:
        raise StoreError("is damaged.", remedy="Restore it from a backup.")

    monkeypatch.setattr(Recordings, "receive", damaged)
    write_test(workspace.spool / "a.modes.json", workspace)
    with pytest.raises(StoreError, match="damaged"):
        run_once(workspace)
    assert (workspace.spool / "a.modes.json").exists()
    monkeypatch.undo()
    with workspace.lock():  # was let go of
        pass


class Mortal(ThreadPoolExecutor):
    """A pool whose workers die once, on the first job."""

    lives = 1

    def __init__(self, settings: Settings):
        super().__init__(settings.workers)

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        if Mortal.lives:
            Mortal.lives -= 1
            raise BrokenExecutor("a worker died")
        return super().submit(fn, *args, **kwargs)


def test_dead_workers_are_replaced(workspace: Workspace, caplog: pytest.LogCaptureFixture) -> None:
    Mortal.lives = 1
    write_test(workspace.spool / "a.modes.json", workspace)
    run_once(workspace, make_executor=Mortal)
    assert "beginning new ones" in caplog.text
    assert counts(workspace) == {Stage.DONE: 1}


def test_a_setting_changed_on_a_page_is_taken_over(
    workspace: Workspace, serve: Callable[..., Wakeup], caplog: pytest.LogCaptureFixture
) -> None:
    serve()
    until(lambda: "watching" in caplog.text)
    key = "hanger.3.thresholds.alert_probability"
    with workspace.store() as store:
        workspace.change_setting(store, key, 0.9, utc_now(), "anna")
    until(lambda: "a setting has changed and is taken over" in caplog.text)


_ODD_NAMES = (
    "x" * 251 + ".csv",  # its sidecar's name would be too long
    "y" * 244 + ".modes.json",
    "two\nlines.csv",
    "tab\t.csv",
    "escape\x1b[31m.csv",
    "turned\u202e.csv",
    "next\x85.csv",
)


def test_no_name_of_a_file_holds_up_the_others(
    workspace: Workspace, serve: Callable[..., Wakeup]
) -> None:
    serve()
    for name in _ODD_NAMES:
        (workspace.spool / name).write_text(f"no recording: {name!r}")
    os.mkfifo(workspace.spool / "pipe.csv")
    write_test(workspace.spool / "good.modes.json", workspace)
    until(lambda: counts(workspace) == {Stage.DONE: 1, Stage.REFUSED: len(_ODD_NAMES)})
    assert [path.name for path in workspace.spool.iterdir()] == ["pipe.csv"]
    assert why_turn_failed(workspace) == ""
    with workspace.store() as store:
        assert check_store(store, lambda *_: None).troubles == ()
        names = [event.subject for event in list_events(store, "refused")]
    assert len(names) == len(_ODD_NAMES)
    assert all(name.isprintable() and len(name) <= 200 for name in names)
