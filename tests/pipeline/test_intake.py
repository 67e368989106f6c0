"""Taking a file in loses nothing and doubles nothing, wherever it is cut short."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from shm.errors import BadInput
from shm.pipeline import intake
from shm.pipeline.intake import receive
from shm.store import Outcome, Receipt, Stage, Workspace
from shm.store.journal import list_events
from shm.store.recordings import Recordings, list_recordings
from tests.helpers.workspaces import START, put


class CutShort(BaseException):
    """Stands for the end of the process."""


def files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def take(workspace: Workspace, name: str) -> Receipt:
    with workspace.store() as store:
        return receive(workspace.spool / name, workspace, store, START)


def test_a_file_goes_from_the_spool_into_archive_and_store(workspace: Workspace) -> None:
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    receipt = take(workspace, "h3.csv")
    assert receipt.outcome is Outcome.NEW
    assert receipt.recording.stage is Stage.RECEIVED
    assert receipt.recording.received_at == START
    assert workspace.archive.holds(receipt.recording.file)
    assert files_in(workspace.spool) == []


def test_a_sidecar_goes_along(workspace: Workspace) -> None:
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    put(workspace.spool / "h3.toml", "hanger = 3\n")
    file = take(workspace, "h3.csv").recording.file
    assert files_in(workspace.spool) == []
    with workspace.archive.opened(file) as path:
        assert path.with_name("h3.toml").read_text() == "hanger = 3\n"


def test_the_same_bytes_under_another_suffix_are_archived_once(workspace: Workspace) -> None:
    for name in ("t1.csv", "t1.txt"):
        put(workspace.spool / name, "content")
    assert [take(workspace, name).outcome for name in ("t1.csv", "t1.txt")] == [
        Outcome.NEW, Outcome.DUPLICATE,
    ]  # fmt: skip
    (kept,) = files_in(workspace.archive.folder)
    assert kept.suffix == ".csv"


def test_a_file_in_a_subfolder_keeps_it_in_its_name(workspace: Workspace) -> None:
    (workspace.spool / "logger").mkdir()
    put(workspace.spool / "logger" / "h3.csv", "force,acc_1\n")
    assert take(workspace, "logger/h3.csv").recording.file.file_name == "logger/h3.csv"


def test_a_file_outside_the_spool_stays_where_it_is(workspace: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    path.write_text("force,acc_1\n")
    with workspace.store() as store:
        first = receive(path, workspace, store, START)
        again = receive(path, workspace, store, START)
    assert path.exists()
    assert first.recording.file.file_name == "mine.csv"
    assert (first.outcome, again.outcome) == (Outcome.NEW, Outcome.DUPLICATE)


@pytest.mark.parametrize(
    ("owner", "verb"),
    [
        (Recordings, "receive"),
        (intake, "_remove"),
        (Path, "unlink"),
        (os, "fsync"),
        (Path, "rename"),
    ],
)
def test_a_receipt_cut_short_anywhere_is_finished_by_the_next(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, owner: object, verb: str
) -> None:
    def cut_short(*args: object, **options: object) -> None:
        raise CutShort

    put(workspace.spool / "h3.csv", "force,acc_1\n")
    put(workspace.spool / "h3.toml", "hanger = 3\n")
    with monkeypatch.context() as patched:
        patched.setattr(owner, verb, cut_short)
        with pytest.raises(CutShort):
            take(workspace, "h3.csv")
    assert (workspace.spool / "h3.csv").exists()
    workspace.archive.sweep()
    receipt = take(workspace, "h3.csv")
    assert receipt.outcome in (Outcome.NEW, Outcome.RESUMED)
    assert receipt.recording.file.sidecar_as is not None
    assert files_in(workspace.spool) == []
    assert len(files_in(workspace.archive.folder)) == 2
    with workspace.store() as store:
        assert len(list_recordings(store)) == 1
        assert list_events(store) == ()


def test_a_receipt_cut_short_between_the_two_removals_is_finished(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    put(workspace.spool / "h3.toml", "hanger = 3\n")
    unlink = Path.unlink

    def only_the_sidecar(self: Path, missing_ok: bool = False) -> None:
        if self.suffix == ".csv":
            raise CutShort
        unlink(self, missing_ok=missing_ok)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", only_the_sidecar)
        with pytest.raises(CutShort):
            take(workspace, "h3.csv")
    receipt = take(workspace, "h3.csv")
    assert receipt.outcome is Outcome.RESUMED
    assert receipt.recording.file.sidecar_as is not None
    assert files_in(workspace.spool) == []


def test_a_file_swapped_for_a_link_after_the_scan_sends_nothing_in(
    workspace: Workspace, tmp_path: Path
) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("secret\n")
    (workspace.spool / "h3.csv").symlink_to(secret)
    with pytest.raises(BadInput, match=r"h3\.csv: it is a link"):
        take(workspace, "h3.csv")
    assert secret.exists()
    assert files_in(workspace.archive.folder) == []


def test_what_came_under_the_same_names_since_it_was_read_stays(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(workspace.spool / "h3.csv", "first\n")
    enter = Recordings.receive

    def enter_while_more_comes(self: Recordings, *args: object) -> Receipt:
        put(workspace.spool / "h3.csv", "second\n")
        put(workspace.spool / "h3.toml", "hanger = 3\n")
        return enter(self, *args)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setattr(Recordings, "receive", enter_while_more_comes)
        assert take(workspace, "h3.csv").outcome is Outcome.NEW
    assert sorted(path.name for path in files_in(workspace.spool)) == ["h3.csv", "h3.toml"]
    second = take(workspace, "h3.csv")
    assert second.outcome is Outcome.NEW
    assert second.recording.file.sidecar_as is not None
    assert files_in(workspace.spool) == []


def test_a_sidecar_swapped_for_a_link_after_the_look_sends_nothing_in(
    workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret = tmp_path / "secret.toml"
    secret.write_text("secret = 1\n")
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    (workspace.spool / "h3.toml").symlink_to(secret)
    with monkeypatch.context() as patched:
        patched.setattr(intake, "_is_plain", lambda sidecar: True)
        with pytest.raises(BadInput, match=r"h3\.toml: it is a link"):
            take(workspace, "h3.csv")
    assert files_in(workspace.archive.folder) == []
    assert take(workspace, "h3.csv").recording.file.sidecar_as is None


def test_a_subfolder_swapped_for_a_link_after_the_scan_sends_nothing_in(
    workspace: Workspace, tmp_path: Path
) -> None:
    (tmp_path / "private").mkdir()
    put(tmp_path / "private" / "h3.csv", "secret\n")
    (workspace.spool / "logger").symlink_to(tmp_path / "private")
    with pytest.raises(BadInput, match="leads out of the spool"):
        take(workspace, "logger/h3.csv")
    assert files_in(workspace.archive.folder) == []


def test_the_spool_itself_may_be_a_link_to_another_disk(
    workspace: Workspace, tmp_path: Path
) -> None:
    workspace.spool.rmdir()
    (tmp_path / "disk").mkdir()
    workspace.spool.symlink_to(tmp_path / "disk")
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    assert take(workspace, "h3.csv").recording.file.file_name == "h3.csv"
    assert files_in(tmp_path / "disk") == []
