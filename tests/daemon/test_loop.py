"""The loop in this process: what it takes, what it waits out, when it ends."""

from __future__ import annotations

import errno
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest

from shm.errors import ShmError, StoreBusy, StoreError
from shm.pipeline import Flow, steps, utc_now
from shm.pipeline.streaming import Streaming
from shm.settings import Settings
from shm.store import Archive, Delivery, Stage, Workspace
from shm.store.checking import check_store
from shm.store.queries.history import list_events
from shm.store.queries.recordings import count_stages
from shm.store.stored_recordings import Recordings
from shm_cli import main as cli
from shm_daemon import Wakeup, run
from shm_daemon.heartbeat import why_turn_failed
from tests.helpers import quick_update
from tests.helpers.flows import threads as make_threads
from tests.helpers.footprint import open_files
from tests.helpers.waiting import until
from tests.helpers.web_servers import served
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


def deliveries(workspace: Workspace) -> tuple[Delivery, ...]:
    with workspace.store() as store:
        return store.alerts.list_deliveries()


def test_files_dropped_while_it_runs_are_done(
    workspace: Workspace, serve: Callable[..., Wakeup]
) -> None:
    serve()
    for day in range(3):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
    until(lambda: counts(workspace) == {Stage.DONE: 3})
    assert list(workspace.spool.iterdir()) == []


@pytest.mark.slow
def test_open_files_do_not_grow_with_the_tests(
    workspace: Workspace, serve: Callable[..., Wakeup]
) -> None:
    serve()
    held = []
    for last in (3, 6, 9):
        for day in range(last - 3, last):
            write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
        until(lambda done=last: counts(workspace) == {Stage.DONE: done})  # type: ignore[misc]
        held.append(min(open_files(os.getpid()) for _ in range(20)))  # a scan opens folders too
    assert held[2] <= held[0]


def test_once_takes_everything_with_its_subfolders_and_ends(workspace: Workspace) -> None:
    (workspace.spool / "logger").mkdir()
    write_test(workspace.spool / "logger" / "a.modes.json", workspace)
    put(workspace.spool / "empty.csv", "")
    run_once(workspace)
    assert counts(workspace) == {Stage.DONE: 1, Stage.REFUSED: 1}
    assert list(workspace.spool.rglob("*")) == [workspace.spool / "logger"]


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
        names = [event.file_name for event in list_events(store, "refused")]
    assert len(names) == len(_ODD_NAMES)
    assert all(name.isprintable() and len(name) <= 200 for name in names)


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


def test_receive_unwritable_archive_shows(
    workspace: Workspace, serve: Callable[..., Wakeup], capsys: pytest.CaptureFixture[str]
) -> None:
    """Wherever people look they see that files are not taken in, and why, until they are."""
    obstacle = workspace.archive.folder / ".incoming"
    obstacle.write_text("where files are copied to")
    write_test(workspace.spool / "a.modes.json", workspace)
    serve()
    until(lambda: "a.modes.json is not taken in" in why_turn_failed(workspace))
    with served(workspace) as site, site.client(Accept="text/html") as client:
        health = client.get("/health")
        home = client.get("/").text
    assert (health.status_code, health.json()["status"]) == (503, "failing")
    assert "a.modes.json is not taken in" in home
    assert str(workspace.folder) not in home
    for verb in ("status", "doctor"):
        cli.run(["--workspace", str(workspace.folder), verb])
        assert "a.modes.json is not taken in" in " ".join(capsys.readouterr().out.split())
    obstacle.unlink()
    (workspace.spool / "a.modes.json").unlink()
    write_test(workspace.spool / "b.modes.json", workspace)
    until(lambda: counts(workspace) == {Stage.DONE: 1})
    until(lambda: why_turn_failed(workspace) == "")


def test_receive_raises_anything(
    workspace: Workspace, serve: Callable[..., Wakeup], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that cannot be taken in for a fault of shm keeps no other file from being done."""
    receive = Flow.receive

    def fail_on_a(self: Flow, path: Path) -> object:
        if path.name.startswith("a"):
            raise KeyError("layout")
        return receive(self, path)

    monkeypatch.setattr(Flow, "receive", fail_on_a)
    for name in "ab":
        write_test(workspace.spool / f"{name}.modes.json", workspace, day=ord(name))
    serve()
    until(lambda: counts(workspace) == {Stage.DONE: 1})
    until(lambda: "a.modes.json is not taken in: KeyError" in why_turn_failed(workspace))


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


def test_advance_delayed_recording_shows(
    workspace: Workspace, serve: Callable[..., Wakeup], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Why a recording waits that was taken in is shown, as why a file waits in the spool."""

    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(steps, "load_modes", fail)
    write_test(workspace.spool / "a.modes.json", workspace)
    serve()
    until(lambda: "recording 1 waits: [Errno 5]" in why_turn_failed(workspace))


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
