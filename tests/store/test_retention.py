"""Old raw files go only where a whole copy of them lies elsewhere; results stay."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from shm.errors import StoreError
from shm.pipeline.intake import receive
from shm.store import Archive, Store, StoredRecording, Workspace
from shm.store.backups import archived_names, check_archive
from shm.store.retention import (
    Retention,
    copy_archive,
    fetch,
    removable,
    remove,
)
from shm.store.upkeep import list_removed
from tests.helpers.contents import quiet
from tests.helpers.workspaces import make_workspace

OLD = datetime(2024, 1, 1, tzinfo=UTC)
NOW = datetime(2026, 1, 1, tzinfo=UTC)
YEAR_AGO = NOW - timedelta(days=365)


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge")


@pytest.fixture
def store(workspace: Workspace) -> Iterator[Store]:
    with workspace.store() as opened:
        yield opened


@pytest.fixture
def copies(tmp_path: Path) -> Archive:
    return Archive(tmp_path / "copies")


def take_in(
    workspace: Workspace,
    store: Store,
    name: str,
    *,
    at: datetime = OLD,
    sidecar: str = "",
    through: bool = True,
) -> StoredRecording:
    """A recording that is through with its work: refused, which is the quickest end."""
    (workspace.spool / f"{name}.csv").write_text(f"contents of {name}")
    if sidecar:
        (workspace.spool / f"{name}.toml").write_text(sidecar)
    recording = receive(workspace.spool / f"{name}.csv", workspace, store, at).recording
    if through:
        store.recordings.refuse(recording.id, {"message": "no", "remedy": "none"}, at)
    return store.recordings.get(recording.id)


def back_up(workspace: Workspace, store: Store, copies: Archive) -> None:
    copy_archive(workspace.archive, copies, archived_names(store), quiet)
    store.upkeep.note_copies(copies, OLD)


def found(workspace: Workspace, store: Store) -> Retention:
    return removable(store, workspace.archive, YEAR_AGO, quiet)


def prune(workspace: Workspace, store: Store) -> int:
    return remove(store, workspace.archive, found(workspace, store).removals, NOW)


def files_of(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("??/*"))


def test_an_old_file_with_a_whole_copy_goes_and_its_row_stays(
    workspace: Workspace, store: Store, copies: Archive
) -> None:
    old = take_in(workspace, store, "old", sidecar="hanger = 3\n")
    young = take_in(workspace, store, "young", at=NOW)
    back_up(workspace, store, copies)
    assert found(workspace, store).size_bytes == len("contents of old") + len("hanger = 3\n")
    assert prune(workspace, store) == len("contents of old") + len("hanger = 3\n")
    assert files_of(workspace.archive.folder) == [Path(str(young.file.archived_as)).name]
    assert len(files_of(copies.folder)) == 3
    assert store.recordings.get(old.id) == old
    assert list_removed(store) == {old.id: str(copies.folder)}
    assert found(workspace, store) == Retention((), {})


def test_without_a_copy_nothing_goes(workspace: Workspace, store: Store) -> None:
    take_in(workspace, store, "old")
    assert found(workspace, store) == Retention((), {"no copy is noted": 1})
    assert prune(workspace, store) == 0
    assert len(files_of(workspace.archive.folder)) == 1


@pytest.mark.parametrize("harm", ["missing", "changed", "sidecar", "unmounted"])
def test_a_copy_that_is_lost_or_changed_is_none(
    workspace: Workspace, store: Store, copies: Archive, harm: str
) -> None:
    old = take_in(workspace, store, "old", sidecar="hanger = 3\n")
    back_up(workspace, store, copies)
    assert old.file.archived_as
    assert old.file.sidecar_as
    copy = copies.folder / (old.file.sidecar_as if harm == "sidecar" else old.file.archived_as)
    if harm == "changed":
        copy.chmod(0o644)
        copy.write_text("contents of 0ld")
    elif harm == "unmounted":
        copies.folder.rename(copies.folder.with_name("away"))
    else:
        copy.unlink()
    assert found(workspace, store) == Retention((), {"no noted copy is whole": 1})
    assert len(files_of(workspace.archive.folder)) == 2


@pytest.mark.parametrize("kind", ["itself", "folder link", "hard link"])
def test_the_archive_itself_is_no_copy_of_it(
    workspace: Workspace, store: Store, tmp_path: Path, kind: str
) -> None:
    """A "copy" that is the same file on the disk would go with it."""
    old = take_in(workspace, store, "old")
    folder = workspace.archive.folder
    if kind == "folder link":
        folder = tmp_path / "link"
        folder.symlink_to(workspace.archive.folder)
    if kind == "hard link":
        folder = tmp_path / "linked"
        place = folder / str(old.file.archived_as)
        place.parent.mkdir(parents=True)
        os.link(workspace.archive.folder / str(old.file.archived_as), place)
    assert store.upkeep.note_copies(Archive(folder), OLD) == 1
    assert found(workspace, store) == Retention((), {"no noted copy is whole": 1})


def test_what_is_not_through_stays(workspace: Workspace, store: Store, copies: Archive) -> None:
    take_in(workspace, store, "waiting", through=False)
    back_up(workspace, store, copies)
    assert found(workspace, store) == Retention((), {"not through yet": 1})


def test_what_was_removed_is_no_trouble_and_comes_back(
    workspace: Workspace, store: Store, copies: Archive
) -> None:
    old = take_in(workspace, store, "old", sidecar="hanger = 3\n")
    back_up(workspace, store, copies)
    prune(workspace, store)
    checked = check_archive(store, workspace.archive, quiet)
    assert (checked.troubles, checked.removed) == ((), 2)
    with pytest.raises(StoreError, match="shm archive fetch"):
        workspace.archive.opened(old.file).__enter__()
    assert fetch(store, workspace.archive, old) == str(copies.folder)
    with workspace.archive.opened(old.file) as path:
        assert path.read_text() == "contents of old"
        assert path.with_suffix(".toml").read_text() == "hanger = 3\n"
    assert check_archive(store, workspace.archive, quiet).removed == 0
