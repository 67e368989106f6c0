"""Forty files, good and bad, and what must have become of them in the end."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path

from shm.store import Stage, Workspace
from shm.store.journal import list_events
from shm.store.posteriors import list_posteriors
from shm.store.recordings import list_recordings
from tests.helpers.workspaces import put, write_test

BAD_EVERY = 4


@dataclass
class Feed:
    """Drops files into a spool, one after the other, each with other contents."""

    workspace: Workspace
    files: dict[str, bytes] = field(default_factory=dict)
    bad: set[str] = field(default_factory=set)
    drafts: Path | None = None

    @property
    def checksums(self) -> dict[str, str]:
        """The SHA-256 of each file, by name."""
        return {name: hashlib.sha256(content).hexdigest() for name, content in self.files.items()}

    def drop(self) -> None:
        name, content = self.made()
        put(self.workspace.spool / name, content)

    def made(self) -> tuple[str, bytes]:
        """The next file, by name and contents."""
        number = len(self.files)
        if number % BAD_EVERY == BAD_EVERY - 1:
            name, content = f"{number:03}.csv", f"# hanger: 3\nnothing,{number}\n".encode()
            self.bad.add(name)
        else:
            name = f"{number:03}.modes.json"
            draft = (self.drafts or self.workspace.folder) / name
            write_test(draft, self.workspace, day=number / 10, tension=1 - number / 1000)
            content = draft.read_bytes()
            draft.unlink()
        self.files[name] = content
        return name, content


def assert_all_done_once(feed: Feed) -> None:
    """Every file stored once and brought to its end, none lost, nothing half written."""
    workspace = feed.workspace
    names = {checksum: name for name, checksum in feed.checksums.items()}
    assert [path for path in workspace.spool.rglob("*") if path.is_file()] == []
    _assert_archive_holds(workspace.folder / "archive", set(names))
    with workspace.store() as store:
        recordings = list_recordings(store)
        assert len(recordings) == len(feed.files)
        assert {r.file.sha256: r.file.file_name for r in recordings} == names
        refused = {r.file.file_name for r in recordings if r.stage is Stage.REFUSED}
        done = {r.file.file_name for r in recordings if r.stage is Stage.DONE}
        assert (refused, done) == (feed.bad, set(feed.files) - feed.bad)
        tests = [test.test.id for test in store.tests.list_all(3)]
        assert tests == sorted(name.removesuffix(".modes.json") for name in done)
        assert len(list_posteriors(store, 3)) == len(tests)
        assert [drift.test for drift in store.watch.list_drifts(3)] == tests[1:]
        assert len(store.watch.list_all(3)) == len(tests) - 1
        assert list_events(store, "duplicate") == ()
    _assert_quarantine_holds(workspace.folder / "quarantine", feed)


def _assert_archive_holds(folder: Path, checksums: set[str]) -> None:
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert {hashlib.sha256(path.read_bytes()).hexdigest() for path in files} == checksums
    assert {path.name.partition(".")[0] for path in files} == checksums
    assert len(files) == len(checksums)


def _assert_quarantine_holds(folder: Path, feed: Feed) -> None:
    expected = feed.bad | {f"{name}.reason.json" for name in feed.bad}
    assert {path.name for path in folder.iterdir()} == expected
    for name in feed.bad:
        assert (folder / name).read_bytes() == feed.files[name]
        assert json.loads((folder / f"{name}.reason.json").read_text())["file"] == name
