"""Raw files: kept for ever by checksum in the archive; refused ones laid out in the quarantine.

Every file appears under its final name whole or not at all (copy, fsync, rename, fsync of the
folder), so that a process may be killed and a machine lose power at any instant.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from shm.documents import dump
from shm.errors import BadInput, ShmError, StoreError
from shm.read import sidecar_path
from shm.store.rows import ReceivedFile

MODES_SUFFIX = ".modes.json"
_CHUNK = 1 << 20
_NAME_BYTES = 200  # file systems end at 255; the quarantine puts ".reason.json" behind
_SUFFIX = re.compile(r"(\.[a-z0-9]{1,12}){1,2}")


def suffix_of(name: str) -> str:
    """The ending that tells a file's format, in lower case; empty where it is none of ours."""
    lower = name.lower()
    suffix = MODES_SUFFIX if lower.endswith(MODES_SUFFIX) else Path(lower).suffix
    return suffix if _SUFFIX.fullmatch(suffix) else ""


def safe_name(path: Path) -> str:
    """A path as text that any file system and database holds: valid UTF-8, its last part short."""
    text = os.fsencode(path.name).decode("utf-8", errors="replace")
    suffix = suffix_of(text)
    stem = text[: len(text) - len(suffix)]
    short = stem.encode()[: _NAME_BYTES - len(suffix)].decode("utf-8", errors="ignore")
    parent = os.fsencode(path.parent).decode("utf-8", errors="replace")
    return Path(parent, short + suffix).as_posix()


def checksum(path: Path) -> str:
    """SHA-256 of a file, as 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class Kept:
    """A file that is safe in the archive; `entry` tells what was read from a later file there."""

    sha256: str
    size_bytes: int
    archived_as: str
    entry: str = field(compare=False)


@dataclass(frozen=True)
class Archive:
    """The folder of raw files, `ab/abcd....csv`; nothing in it is ever changed."""

    folder: Path

    def keep(self, source: Path, *, follow: bool = False) -> Kept:
        """Copies a file in under its checksum; bytes that are there already are left alone.

        All is read from one descriptor. A link is refused unless it is to be followed: by one,
        whoever writes into the spool could send in any file of this machine. Raises BadInput where
        it is a link or no file, ShmError with `retry_after_s` where the file changes while it is
        copied or where the disk is full.
        """
        with self._incoming() as temporary, _opened(source, follow) as reading:
            before = os.fstat(reading.fileno())
            sha256, size = _copy_hashed(reading, temporary)
            if _mark(source.stat(follow_symlinks=follow)) != _mark(before):
                raise ShmError(
                    f"{source.name} changed while it was read.",
                    remedy="It is tried again.",
                    retry_after_s=1.0,
                )
            relative = Path(sha256[:2]) / f"{sha256}{suffix_of(source.name)}"
            self._place(temporary, self.folder / relative)
        return Kept(sha256, size, relative.as_posix(), entry_of(before))

    def holds(self, file: ReceivedFile) -> bool:
        """Whether the file is there, as it should be."""
        return file.archived_as is not None and (self.folder / file.archived_as).is_file()

    @contextmanager
    def opened(self, file: ReceivedFile) -> Iterator[Path]:
        """The file under the name it came with, its sidecar beside it, while the context lasts.

        What fails meanwhile because another process has begun to serve, and swept the archive,
        is an ShmError with `retry_after_s`: the file itself is not to blame.
        """
        if file.archived_as is None or not self.holds(file):
            raise StoreError(
                f"{file.file_name} is not in the archive.",
                remedy="Fetch a copy with `shm archive fetch`, or drop the file again.",
            )
        views = self.folder / ".open"
        views.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(dir=views) as view:
            path = Path(view) / Path(file.file_name).name
            _link(self.folder / file.archived_as, path)
            if file.sidecar_as is not None:
                _link(self.folder / file.sidecar_as, sidecar_path(path))
            try:
                yield path
            except Exception as error:
                if path.exists():
                    raise
                raise ShmError(
                    f"{file.file_name} was put away while it was read: another process serves now.",
                    remedy="It is tried again.",
                    retry_after_s=1.0,
                ) from error

    def sweep(self) -> None:
        """Removes what a killed process left; only for the holder of the workspace's lock."""
        for leftover in (".incoming", ".open"):
            shutil.rmtree(self.folder / leftover, ignore_errors=True)

    @contextmanager
    def _incoming(self) -> Iterator[Path]:
        folder = self.folder / ".incoming"
        try:
            folder.mkdir(exist_ok=True)
            with tempfile.TemporaryDirectory(dir=folder) as temporary:
                yield Path(temporary) / "file"
        except OSError as error:
            raise _explained(error, self.folder) from error

    def _place(self, temporary: Path, final: Path) -> None:
        if not final.exists():
            final.parent.mkdir(exist_ok=True)
            temporary.chmod(0o444)
            temporary.rename(final)
            sync(final.parent)
            sync(self.folder)


@dataclass(frozen=True)
class Quarantine:
    """The folder of refused files; each has its reason in `NAME.reason.json` beside it."""

    folder: Path

    def put(self, source: Path, name: str, reason: Mapping[str, Any], sidecar: Path) -> Path:
        """Lays a copy out with its reason and its sidecar, if there is one.

        Other files of that name are left as they are.
        """
        target = self._free_place(Path(name).name, str(reason["sha256"]))
        try:
            if sidecar.is_file():
                _copy_whole(sidecar, sidecar_path(target))
            _copy_whole(source, target)
            _write_whole(dump(reason) + "\n", target.with_name(f"{target.name}.reason.json"))
        except OSError as error:
            raise _explained(error, self.folder) from error
        return target

    def _free_place(self, name: str, sha256: str) -> Path:
        """`name` itself, or with a piece of the checksum where another file has that name."""
        target = self.folder / name
        if not target.exists() or checksum(target) == sha256:
            return target
        suffix = suffix_of(name)
        return self.folder / f"{name[: len(name) - len(suffix)]}-{sha256[:8]}{suffix}"


def entry_of(status: os.stat_result) -> str:
    """What tells one file of a folder from a later one of the same name and contents."""
    return f"{status.st_ino}-{status.st_ctime_ns}"


def _mark(status: os.stat_result) -> tuple[int, int, int]:
    return status.st_ino, status.st_size, status.st_mtime_ns


@contextmanager
def _opened(source: Path, follow: bool) -> Iterator[BinaryIO]:
    """A regular file to read. Opening does not wait, as it would for a named pipe."""
    flags = os.O_RDONLY | os.O_NONBLOCK | (0 if follow else os.O_NOFOLLOW)
    try:
        descriptor = os.open(source, flags)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise BadInput(
            "it is a link, which may lead to any file of this machine and is not followed.",
            file=source,
            remedy="Put the file itself in its place.",
        ) from None
    with os.fdopen(descriptor, "rb") as reading:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise BadInput("it is no file.", file=source, remedy="Put a file in its place.")
        yield reading


def _copy_hashed(reading: BinaryIO, target: Path) -> tuple[str, int]:
    digest, size = hashlib.sha256(), 0
    with target.open("wb") as writing:
        while chunk := reading.read(_CHUNK):
            digest.update(chunk)
            size += len(chunk)
            writing.write(chunk)
        writing.flush()
        os.fsync(writing.fileno())
    return digest.hexdigest(), size


def _copy_whole(source: Path, target: Path) -> None:
    temporary = target.with_name(f".{target.name}.part")
    temporary.unlink(missing_ok=True)
    with source.open("rb") as reading:
        _copy_hashed(reading, temporary)
    temporary.rename(target)
    sync(target.parent)


def _write_whole(text: str, target: Path) -> None:
    temporary = target.with_name(f".{target.name}.part")
    with temporary.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    temporary.rename(target)
    sync(target.parent)


def sync(path: Path) -> None:
    """Forces a file, or a folder's list of names, to disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _link(source: Path, target: Path) -> None:
    try:
        target.hardlink_to(source)
    except OSError:  # some network and memory-stick file systems know no links
        shutil.copyfile(source, target)


def _explained(error: OSError, folder: Path) -> ShmError:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return StoreError(
            f"{folder} cannot grow: the disk is full.",
            remedy="Free some space; it is tried again.",
            retry_after_s=60.0,
        )
    return ShmError(
        f"{folder} or a file for it cannot be used: {error}.",
        remedy="Check its permissions; it is tried again.",
        retry_after_s=60.0,
    )
