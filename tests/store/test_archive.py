"""The archive keeps raw files for ever, whole, once; the quarantine overwrites nothing."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
from pathlib import Path
from typing import Any, BinaryIO

import pytest

from shm.errors import BadInput, ShmError, StoreError
from shm.store import Archive, Quarantine, ReceivedFile, archive
from shm.store.archive import checksum, safe_name

REASON = {"message": "no sampling rate.", "remedy": "Give it.", "sha256": "0" * 64}


@pytest.fixture
def kept_in(tmp_path: Path) -> Archive:
    folder = tmp_path / "archive"
    folder.mkdir()
    return Archive(folder)


@pytest.fixture
def quarantine(tmp_path: Path) -> Quarantine:
    folder = tmp_path / "quarantine"
    folder.mkdir()
    return Quarantine(folder)


def a_source(tmp_path: Path, name: str = "h3.csv", content: bytes = b"force,acc_1\n") -> Path:
    path = tmp_path / name
    path.write_bytes(content)
    return path


def files_in(folder: Path) -> list[Path]:
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def test_a_file_is_kept_under_its_checksum_and_cannot_be_written(
    kept_in: Archive, tmp_path: Path
) -> None:
    source = a_source(tmp_path)
    kept = kept_in.keep(source)
    digest = hashlib.sha256(b"force,acc_1\n").hexdigest()
    assert (kept.sha256, kept.size_bytes) == (digest, 12)
    assert kept.archived_as == f"{digest[:2]}/{digest}.csv"
    target = kept_in.folder / kept.archived_as
    assert target.read_bytes() == source.read_bytes()
    assert stat.S_IMODE(target.stat().st_mode) == 0o444
    assert files_in(kept_in.folder) == [Path(kept.archived_as)]


def test_keeping_the_same_bytes_again_changes_nothing(kept_in: Archive, tmp_path: Path) -> None:
    first = kept_in.keep(a_source(tmp_path))
    kept = kept_in.folder / first.archived_as
    # Reading it to compare may touch the time of access.
    before = kept.stat()
    assert kept_in.keep(a_source(tmp_path, "copy.csv")) == first
    assert (kept.stat().st_ino, kept.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert len(files_in(kept_in.folder)) == 1


def test_a_file_that_changes_while_it_is_read_is_not_kept(
    kept_in: Archive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = a_source(tmp_path)
    copy = archive._copy_hashed

    def copy_and_append(reading: BinaryIO, target: Path, *more: Any) -> tuple[str, int]:
        result = copy(reading, target, *more)
        with source.open("ab") as file:
            file.write(b"1,2\n")
        return result

    monkeypatch.setattr(archive, "_copy_hashed", copy_and_append)
    with pytest.raises(ShmError, match=r"h3\.csv changed") as caught:
        kept_in.keep(source)
    assert caught.value.retry_after_s == 1.0
    assert files_in(kept_in.folder) == []


@pytest.mark.parametrize(("code", "error"), [(errno.ENOSPC, StoreError), (errno.EACCES, ShmError)])
def test_a_disk_that_fails_is_told_and_leaves_nothing_behind(
    kept_in: Archive,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    code: int,
    error: type[ShmError],
) -> None:
    def fail(descriptor: int) -> None:
        raise OSError(code, os.strerror(code))

    source = a_source(tmp_path)
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(error) as caught:
        kept_in.keep(source)
    assert type(caught.value) is error
    assert caught.value.retry_after_s == 60.0
    assert files_in(kept_in.folder) == []
    assert source.exists()


def test_a_kept_file_opens_under_the_name_it_came_with(kept_in: Archive, tmp_path: Path) -> None:
    kept = kept_in.keep(a_source(tmp_path))
    sidecar = kept_in.keep(a_source(tmp_path, "h3.toml", b"hanger = 3\n"))
    file = ReceivedFile(
        kept.sha256, "logger/h3.csv", 12, "entry", kept.archived_as, sidecar.archived_as
    )
    with kept_in.opened(file) as path:
        assert path.name == "h3.csv"
        assert path.read_bytes() == b"force,acc_1\n"
        assert path.with_name("h3.toml").read_bytes() == b"hanger = 3\n"
    assert not path.exists()
    assert len(files_in(kept_in.folder)) == 2


def test_a_file_that_is_gone_from_the_archive_is_told(kept_in: Archive) -> None:
    file = ReceivedFile("f" * 64, "h3.csv", 12, "entry", "ff/f.csv")
    assert not kept_in.holds(file)
    with pytest.raises(StoreError, match="not in the archive"), kept_in.opened(file):
        pytest.fail("opened")


def test_what_a_killed_process_left_is_swept(kept_in: Archive, tmp_path: Path) -> None:
    kept = kept_in.keep(a_source(tmp_path))
    for name in (".incoming", ".open"):
        leftover = kept_in.folder / name / "tmpabc"
        leftover.mkdir(parents=True)
        (leftover / "file").write_text("half")
    kept_in.sweep()
    assert files_in(kept_in.folder) == [Path(kept.archived_as)]


def test_a_link_is_followed_only_where_that_is_asked_for(kept_in: Archive, tmp_path: Path) -> None:
    link = tmp_path / "link.csv"
    link.symlink_to(a_source(tmp_path, "secret.csv"))
    with pytest.raises(BadInput, match=r"link\.csv: it is a link"):
        kept_in.keep(link)
    assert files_in(kept_in.folder) == []
    assert kept_in.keep(link, follow=True).size_bytes == 12


@pytest.mark.timeout(10)
def test_a_named_pipe_is_refused_and_not_waited_for(kept_in: Archive, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(BadInput, match=r"pipe\.csv: it is no file"):
        kept_in.keep(tmp_path / "pipe.csv")


def test_a_refused_file_lies_with_its_reason_and_sidecar(
    quarantine: Quarantine, tmp_path: Path
) -> None:
    sidecar = a_source(tmp_path, "h3.toml", b"hanger = 3\n")
    target = quarantine.put(a_source(tmp_path), "logger/h3.csv", REASON, sidecar)
    assert target == quarantine.folder / "h3.csv"
    assert files_in(quarantine.folder) == [
        Path("h3.csv"),
        Path("h3.csv.reason.json"),
        Path("h3.toml"),
    ]
    assert json.loads((quarantine.folder / "h3.csv.reason.json").read_text()) == REASON


def test_another_refused_file_of_the_same_name_is_laid_beside_it(
    quarantine: Quarantine, tmp_path: Path
) -> None:
    none = tmp_path / "none.toml"
    for content in (b"one", b"two", b"two"):
        source = a_source(tmp_path, content=content)
        sha256 = checksum(source)
        quarantine.put(source, "h3.csv", {**REASON, "sha256": sha256}, none)
    other = f"h3-{checksum(source)[:8]}.csv"
    assert files_in(quarantine.folder) == sorted(
        Path(name) for name in ("h3.csv", "h3.csv.reason.json", other, f"{other}.reason.json")
    )
    assert (quarantine.folder / "h3.csv").read_bytes() == b"one"
    assert (quarantine.folder / other).read_bytes() == b"two"


def test_names_that_no_database_or_file_system_holds_are_made_safe() -> None:
    raw = Path(os.fsdecode(b"caf\xe9.csv"))
    assert safe_name(raw) == "caf\ufffd.csv"
    long = safe_name(Path("sub") / ("å" * 126 + ".csv"))
    assert len(Path(long).name.encode()) <= 200
    assert long.startswith("sub/å")
    assert long.endswith("å.csv")
    assert safe_name(Path("logger/h3.csv")) == "logger/h3.csv"


def rotten(kept_in: Archive, tmp_path: Path) -> tuple[Path, ReceivedFile]:
    """A kept file of which one bit has flipped since."""
    kept = kept_in.keep(a_source(tmp_path, content=b"force,acc_1\n1,2\n"))
    path = kept_in.folder / kept.archived_as
    path.chmod(0o644)
    path.write_bytes(b"force,acc_1\n1,3\n")
    path.chmod(0o444)
    return path, ReceivedFile(kept.sha256, "h3.csv", kept.size_bytes, "e", kept.archived_as)


def test_a_rotten_file_is_refused_at_every_read_with_the_remedy(
    kept_in: Archive, tmp_path: Path
) -> None:
    path, file = rotten(kept_in, tmp_path)
    with (
        pytest.raises(
            StoreError, match=rf"h3.csv is damaged in the archive: .*{path.name}"
        ) as told,
        kept_in.opened(file),
    ):
        pass
    assert "into the spool again" in told.value.remedy
    assert not kept_in.holds_whole(file)


def test_the_good_file_that_comes_again_heals_the_rotten_one(
    kept_in: Archive, tmp_path: Path
) -> None:
    path, file = rotten(kept_in, tmp_path)
    kept_in.keep(a_source(tmp_path, content=b"force,acc_1\n1,2\n"))
    assert checksum(path) == file.sha256
    with kept_in.opened(file) as shown:
        assert shown.read_bytes() == b"force,acc_1\n1,2\n"
