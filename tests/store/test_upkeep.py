"""What is found wrong in a store and an archive, how it is named, and what heals it."""

from __future__ import annotations

import sqlite3
from datetime import timedelta
from pathlib import Path

import pytest

from shm.store import Store, backups
from shm.store.archive import Archive, Quarantine
from shm.store.backups import (
    CheckedArchive,
    check_archive,
    check_store,
    quick_troubles,
    unknown_files,
)
from shm.store.recordings import list_recordings
from shm.store.upkeep import find_last_backup, find_newest_step
from tests.helpers.contents import quiet
from tests.helpers.nouns import NOW, a_file

HOUR = timedelta(hours=1)


def test_the_last_backup_is_the_newest(file_store: Store) -> None:
    upkeep = file_store.upkeep
    assert find_last_backup(file_store) is find_newest_step(file_store) is None
    for hours in (0, 2):
        upkeep.note_backup(Path(f"/backups/{hours}.db"), NOW + hours * HOUR)
    assert find_last_backup(file_store) == (NOW + 2 * HOUR, "/backups/2.db")
    file_store.recordings.receive(a_file(1), NOW + 3 * HOUR)
    assert find_newest_step(file_store) == NOW + 3 * HOUR


def test_an_archive_says_what_is_missing_changed_and_of_nobody(
    file_store: Store, tmp_path: Path
) -> None:
    archive = Archive(tmp_path / "archive")
    archive.folder.mkdir()
    contents = (b"one", b"two", b"three")
    for number, content in enumerate(contents, start=1):
        source = tmp_path / "new.csv"
        source.write_bytes(content)
        kept = archive.keep(source)
        names = {"sha256": kept.sha256, "archived_as": kept.archived_as}
        file_store.recordings.receive(a_file(number, **names), NOW)
    names = [each.file.archived_as or "" for each in list_recordings(file_store)]
    told: list[float] = []
    whole = check_archive(file_store, archive, lambda _, share: told.append(share))
    assert (whole.whole, whole.troubles, whole.findings) == (3, (), ())
    assert told == pytest.approx([1 / 3, 2 / 3, 1])
    (archive.folder / names[0]).unlink()
    changed = archive.folder / names[1]
    changed.chmod(0o644)
    changed.write_bytes(b"owt")
    stray = archive.folder / "ab" / "ab12.csv"
    stray.parent.mkdir()
    stray.touch()
    stray.with_name("ab12.csv.toml").touch()
    found = check_archive(file_store, archive, quiet)
    assert found.whole == 1
    assert (found.missing, found.damaged) == ((names[0],), (names[1],))
    assert found.troubles == (
        f"{names[0]} is not in the archive",
        f"{names[1]} of the archive has another SHA-256",
    )
    assert [(each.kind, each.where) for each in found.findings] == [
        ("missing raw file", f"archive/{names[0]}"),
        ("damaged raw file", f"archive/{names[1]}"),
    ]
    assert unknown_files(file_store, archive)[0] == "ab/ab12.csv"
    assert CheckedArchive(1, (), (), ()).removed == 0


def test_a_refused_file_is_moved_with_its_reason_and_its_sidecar(tmp_path: Path) -> None:
    quarantine = Quarantine(tmp_path / "refused")
    quarantine.folder.mkdir()
    reason = {"message": "too large.", "remedy": "Cut it.", "sha256": "a" * 64}
    for content in ("first", "second"):
        source = tmp_path / "a.csv"
        source.write_text(content)
        sidecar = tmp_path / "a.csv.toml"
        sidecar.write_text("hanger = 3")
        target = quarantine.move(source, "a.csv", reason, sidecar)
        assert not source.exists()
        assert not sidecar.exists()
        assert target.read_text() == content
        assert target.with_name(f"{target.name}.reason.json").is_file()
    assert len({path.name for path in quarantine.folder.glob("a*.csv")}) == 2


def test_check_store_findings(filled_copy: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has its kind, its place and its remedy; a changed schema keeps no backup out."""
    whole = check_store(filled_copy, quiet)
    assert whole.findings == whole.unfit == quick_troubles(filled_copy) == ()
    with sqlite3.connect(filled_copy.engine.url.database or "") as connection:
        connection.execute("DELETE FROM posteriors WHERE id = 1")
        connection.execute("DROP INDEX ix_posterior_tests_test_id")
    connection.close()
    found = check_store(filled_copy, quiet)
    *references, schema = found.findings
    assert {each.kind for each in references} == {"broken reference"}
    assert ("posterior_tests/1", "it refers to a row of posteriors that is not there.") in [
        (each.where, each.what) for each in references
    ]
    assert (schema.kind, schema.where) == ("changed schema", "index ix_posterior_tests_test_id")
    assert "shm db backup FILE" in schema.remedy
    assert found.unfit == found.troubles[:-1]
    monkeypatch.setattr(backups, "_faults", lambda *_: ("the file is damaged: page 3",))
    file = check_store(filled_copy, quiet).findings[0]
    assert (file.kind, file.where, file.what) == (
        "fault of the file", "store", "the file is damaged: page 3.",
    )  # fmt: skip
