"""What is too large is neither read nor copied, on whatever way it comes; the heart goes on."""

from __future__ import annotations

import errno
import json
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from shm.errors import TooLarge
from shm.pipeline.intake import receive
from shm.store import Archive, Stage, Workspace
from shm.store.queries.history import list_events
from shm.store.queries.recordings import list_recordings
from shm_daemon import Wakeup, run
from shm_daemon.heartbeat import HEARTBEAT
from tests.helpers.flows import threads
from tests.helpers.waiting import until
from tests.helpers.workspaces import START, make_workspace, put, write_test

HUNDRED_GB = 100 * 10**9


def sparse(path: Path, size_bytes: int = HUNDRED_GB) -> Path:
    with path.open("wb") as file:
        file.truncate(size_bytes)
    os.utime(path, (1e9, 1e9))
    return path


def on_disk(folder: Path) -> int:
    return sum(path.lstat().st_blocks * 512 for path in folder.rglob("*"))


@contextmanager
def serving(workspace: Workspace) -> Iterator[None]:
    """Yield a daemon that runs until the end of the block."""
    wakeup = Wakeup()
    daemon = threading.Thread(
        target=run, args=(workspace,), kwargs={"wakeup": wakeup, "make_executor": threads}
    )
    daemon.start()
    try:
        yield
    finally:
        wakeup.stop()
        daemon.join(120)


def test_a_hundred_sparse_gigabytes_go_to_the_quarantine_unread(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    sparse(workspace.spool / "huge.csv")
    put(workspace.spool / "huge.toml", "hanger = 3\n")
    write_test(workspace.spool / "good.modes.json", workspace)
    before = on_disk(workspace.folder)
    run(workspace, once=True, make_executor=threads)
    assert on_disk(workspace.folder) - before < 1_000_000
    assert list(workspace.spool.iterdir()) == []
    folder = workspace.quarantine.folder
    assert (folder / "huge.csv").stat().st_size == HUNDRED_GB
    assert (folder / "huge.toml").exists()
    reason = json.loads((folder / "huge.csv.reason.json").read_text())
    assert reason["message"] == f"{HUNDRED_GB} bytes are more than the 1000000000 that are taken."
    assert "max_file_bytes" in reason["remedy"]
    with workspace.store() as store:
        assert [each.stage for each in list_recordings(store)] == [Stage.DONE]
        assert [event.file_name for event in list_events(store, "refused")] == ["huge.csv"]


def test_what_cannot_be_moved_stays_where_it_is_and_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    huge = sparse(workspace.spool / "huge.csv")
    rename = Path.rename

    def other_disk(self: Path, target: Path) -> Path:
        if self == huge:
            raise OSError(errno.EXDEV, os.strerror(errno.EXDEV))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", other_disk)
    run(workspace, once=True, make_executor=threads)
    with serving(workspace):
        time.sleep(2.0)
    assert huge.exists()
    assert on_disk(workspace.quarantine.folder) < 100_000
    reason = json.loads((workspace.quarantine.folder / "huge.csv.reason.json").read_text())
    assert f"left at {huge}" in reason["remedy"]
    with workspace.store() as store:
        assert len(list_events(store, "refused")) == 1


def test_a_file_that_a_person_names_is_refused_unread_and_stays(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    huge = sparse(tmp_path / "huge.csv")
    with workspace.store() as store, pytest.raises(TooLarge, match="that are taken"):
        receive(huge, workspace, store, START)
    assert huge.exists()
    assert list(workspace.quarantine.folder.iterdir()) == []


def test_a_sidecar_that_is_too_large_takes_its_file_along(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    sparse(workspace.spool / "h3.toml")
    run(workspace, once=True, make_executor=threads)
    lies = sorted(path.name for path in workspace.quarantine.folder.iterdir())
    assert lies == ["h3.csv", "h3.csv.reason.json", "h3.toml"]
    assert [path for path in workspace.archive.folder.rglob("*") if path.is_file()] == []


def test_a_file_that_grows_while_it_is_copied_is_not_followed_beyond_what_was_judged(
    tmp_path: Path,
) -> None:
    archive, path = Archive(tmp_path / "archive"), tmp_path / "grows.csv"
    archive.folder.mkdir()
    path.write_bytes(b"1" * (3 << 20))
    copied = 0

    def grow() -> None:
        nonlocal copied
        copied += 1
        with path.open("ab") as file:
            file.write(b"1" * (4 << 20))

    with pytest.raises(Exception, match="changed while it was read"):
        archive.keep(path, most_bytes=4 << 20, on_progress=grow)
    assert copied <= 4


@pytest.mark.slow
def test_the_holes_of_a_permitted_file_stay_holes_and_its_bytes_the_same(tmp_path: Path) -> None:
    archive, path = Archive(tmp_path / "archive"), sparse(tmp_path / "a.csv", 200 << 20)
    archive.folder.mkdir()
    with path.open("r+b") as file:
        file.seek(70 << 20)
        file.write(b"something")
    kept = archive.keep(path)
    copy = archive.folder / kept.archived_as
    assert copy.stat().st_size == path.stat().st_size == kept.size_bytes
    assert copy.stat().st_blocks * 512 < 8 << 20
    assert copy.read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_the_heart_beats_while_a_large_permitted_file_is_copied_and_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each MB takes 50 ms, as on a slow card: 4 s to archive, and again for the quarantine."""
    workspace = make_workspace(tmp_path / "bridge", settings={"spool_scan_seconds": 30.0})
    (workspace.spool / "large.csv").write_bytes(os.urandom(1 << 20) * 80)
    heart, beats = workspace.folder / HEARTBEAT, set[float]()
    digest, slow = "shm.store.archive.hashlib.sha256", __import__("hashlib").sha256

    class Slow:
        def __init__(self) -> None:
            self.inner = slow()

        def update(self, chunk: bytes) -> None:
            time.sleep(0.05 * len(chunk) / (1 << 20))
            beats.add(heart.stat().st_mtime)
            self.inner.update(chunk)

        def digest(self) -> bytes:
            return bytes(self.inner.digest())

        def hexdigest(self) -> str:
            return str(self.inner.hexdigest())

    monkeypatch.setattr(digest, lambda data=b"": slow(data) if data else Slow())
    with serving(workspace):
        until(lambda: not (workspace.spool / "large.csv").exists())
    assert len(beats) > 2  # while it was copied
    with workspace.store() as store:
        assert len(list_recordings(store)) == 1
