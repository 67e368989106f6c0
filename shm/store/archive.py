"""Raw files: kept for ever by checksum in the archive; refused ones laid out in the quarantine.

Every file appears under its final name whole or not at all (copy, fsync, rename, fsync of the
folder), so that a process may be killed and a machine lose power at any instant.
"""

from __future__ import annotations

import errno
import hashlib
import logging
import math
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from shm.documents import dump
from shm.errors import DISK_FULL, BadInput, ShmError, StoreError, TooLarge
from shm.read import sidecar_path
from shm.store.rows import ReceivedFile
from shm.values import printable

log = logging.getLogger(__name__)

MODES_SUFFIX = ".modes.json"
_FETCH = "Drop the file into the spool again, which heals it, or run `shm archive fetch`."
_CHUNK = 1 << 20  # technical: 1 MB, between which the heart beats
_SYNC_BYTES = 16 << 20  # a slow memory card takes some 2 s for so much, and nobody waits longer
_NAME_BYTES = 200  # file systems end at 255; the quarantine puts ".reason.json" behind
_SUFFIX = re.compile(r"(\.[a-z0-9]{1,12}){1,2}")


def suffix_of(name: str) -> str:
    """The ending that tells a file's format, in lower case; empty where it is none of ours."""
    lower = name.lower()
    suffix = MODES_SUFFIX if lower.endswith(MODES_SUFFIX) else Path(lower).suffix
    return suffix if _SUFFIX.fullmatch(suffix) else ""


def safe_name(path: Path) -> str:
    """A path as text for any file system, database, log: printable UTF-8, its last part short."""
    text = _printable(path.name)
    suffix = suffix_of(text)
    stem = text[: len(text) - len(suffix)].encode()[: _NAME_BYTES - len(suffix)]
    return Path(_printable(path.parent), stem.decode(errors="ignore") + suffix).as_posix()


def _printable(part: str | Path) -> str:
    return printable(os.fsencode(part).decode(errors="replace"))


ProgressCallback = Callable[[], object]
"""What is called again and again while a file is copied or hashed, to show that all is well."""


def do_nothing() -> None:
    """Nothing to do meanwhile."""


def refuse_oversize(
    size_bytes: int, most_bytes: float, file: str | Path = "", setting: str = "max_file_bytes"
) -> None:
    """Raises TooLarge: the one judge of size for whatever comes in, on whatever way."""
    if size_bytes > most_bytes:
        raise TooLarge(
            f"{size_bytes} bytes are more than the {most_bytes} that are taken.",
            file=file,
            remedy=f"Send it in parts, or raise the setting {setting}.",
        )


def checksum(path: Path, on_progress: ProgressCallback = do_nothing) -> str:
    """SHA-256 of a file, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
            on_progress()
    return digest.hexdigest()


def is_whole(path: Path) -> bool:
    """Return True if a file of an archive has the SHA-256 that it is named by."""
    try:
        return checksum(path) == path.name[:64]
    except OSError:
        return False


@dataclass(frozen=True)
class ArchivedFile:
    """A file that is safe in the archive; `entry` tells what was read from a later file there."""

    sha256: str
    size_bytes: int
    archived_as: str
    entry: str = field(compare=False)


@dataclass(frozen=True)
class Archive:
    """The folder of raw files, `ab/abcd....csv`; nothing in it is ever changed."""

    folder: Path

    def keep(
        self,
        source: Path,
        *,
        follow: bool = False,
        most_bytes: float = math.inf,
        on_progress: ProgressCallback = do_nothing,
        under_any_suffix: bool = False,
    ) -> ArchivedFile:
        """Copies a file in under its checksum; bytes that are there already are left alone.

        So are those that are there `under_any_suffix`, if asked: the suffix tells nobody anything.
        Where those have rotted, which their name tells, the good ones take their place.
        Raises TooLarge before a byte of a file of more than `most_bytes` is read.

        All is read from one descriptor. A link is refused unless it is to be followed: by one,
        whoever writes into the spool could send in any file of this machine. Raises BadInput where
        it is a link or no file, ShmError with `retry_after_s` where the file changes while it is
        copied or where the disk is full.
        """
        with self._incoming() as temporary, _opened(source, follow) as reading:
            before = os.fstat(reading.fileno())
            refuse_oversize(before.st_size, most_bytes, source)
            sha256, size = _copy_hashed(reading, temporary, before.st_size, on_progress)
            now = source.stat(follow_symlinks=follow)
            if _mark(now) != _mark(before) or size != before.st_size:
                raise ShmError(
                    f"{source.name} changed while it was read.",
                    remedy="It is tried again.",
                    retry_after_s=1.0,
                )
            relative = Path(sha256[:2]) / f"{sha256}{suffix_of(source.name)}"
            if under_any_suffix and not (self.folder / relative).exists():
                there = (self.folder / sha256[:2]).glob(f"{sha256}*")
                relative = min((path.relative_to(self.folder) for path in there), default=relative)
            self._place(temporary, self.folder / relative)
        return ArchivedFile(sha256, size, relative.as_posix(), inode_identity(before))

    def refuse_damaged(self, file: ReceivedFile) -> None:
        """Raises StoreError where a file or its sidecar is missing or is not as it was kept."""
        if file.archived_as is None or not self.holds(file):
            raise StoreError(f"{file.file_name} is not in the archive.", remedy=_FETCH)
        for name in (file.archived_as, file.sidecar_as):
            if name is not None and not is_whole(self.folder / name):
                raise StoreError(
                    f"{file.file_name} is damaged in the archive: archive/{name} has not the "
                    "SHA-256 that it is named by.",
                    remedy=_FETCH,
                )

    def holds_whole(self, file: ReceivedFile) -> bool:
        """Return True if the file and its sidecar are there as they were kept; reads them."""
        try:
            self.refuse_damaged(file)
        except StoreError:
            return False
        return True

    def holds(self, file: ReceivedFile) -> bool:
        """Return True if the file is there; what is in it is looked at where it is read."""
        return file.archived_as is not None and (self.folder / file.archived_as).is_file()

    @contextmanager
    def opened(self, file: ReceivedFile) -> Iterator[Path]:
        """The file under the name it came with, its sidecar beside it, while the context lasts.

        Both are compared with their checksums first. Raises StoreError where one is not as it was.
        What fails meanwhile because another process has begun to serve, and swept the archive,
        is an ShmError with `retry_after_s`: the file itself is not to blame.
        """
        self.refuse_damaged(file)
        assert file.archived_as is not None
        views = self.folder / ".open"
        with ExitStack() as stack:
            try:
                views.mkdir(exist_ok=True)
                view = stack.enter_context(tempfile.TemporaryDirectory(dir=views))
                path = Path(view) / Path(file.file_name).name
                _link(self.folder / file.archived_as, path)
                if file.sidecar_as is not None:
                    _link(self.folder / file.sidecar_as, sidecar_path(path))
            except OSError as error:
                raise disk_error(error, self.folder) from error
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
            raise disk_error(error, self.folder) from error

    def _place(self, temporary: Path, final: Path) -> None:
        rotten = final.exists() and not is_whole(final)
        if rotten:
            log.warning("%s was damaged in the archive; the file that came again heals it", final)
        if rotten or not final.exists():
            final.parent.mkdir(exist_ok=True)
            temporary.chmod(0o444)
            temporary.rename(final)
            sync(final.parent)
            sync(self.folder)


@dataclass(frozen=True)
class Quarantine:
    """The folder of refused files; each has its reason in `NAME.reason.json` beside it."""

    folder: Path

    def put(
        self,
        source: Path,
        name: str,
        reason: Mapping[str, Any],
        sidecar: Path,
        on_progress: ProgressCallback = do_nothing,
    ) -> Path:
        """Lays a copy out with its reason and its sidecar, if there is one.

        Other files of that name are left as they are.
        """
        same = partial(self._holds, source, str(reason["sha256"]), on_progress)
        target = self._free_place(Path(name).name, str(reason["sha256"])[:8], same)
        try:
            if sidecar.is_file():
                _copy_whole(sidecar, sidecar_path(target), on_progress)
            _copy_whole(source, target, on_progress)
            self._explain(target, reason)
        except OSError as error:
            raise disk_error(error, self.folder) from error
        return target

    def move(self, source: Path, name: str, reason: Mapping[str, Any], sidecar: Path) -> Path:
        """Moves a file here with its reason and its sidecar, neither read nor copied.

        Where that cannot be, as from another file system, it stays where it is, with its reason
        here. Gives where it lies then.
        """
        entry = inode_identity(source.lstat())
        target = self._free_place(Path(name).name, entry, lambda there: not there.exists())
        try:
            self._explain(target, reason)  # first: a file here is never without
            if sidecar.is_file() and not sidecar.is_symlink():
                sidecar.rename(sidecar_path(target))
            source.rename(target)
            sync(self.folder)
        except OSError as error:
            if error.errno in DISK_FULL:
                raise disk_error(error, self.folder) from error
            stays = f"It was left at {source}, as it cannot be moved ({error.strerror})."
            self._explain(target, {**reason, "remedy": f"{reason['remedy']} {stays}"})
            return source
        return target

    def _explain(self, target: Path, reason: Mapping[str, Any]) -> None:
        _write_whole(dump(reason) + "\n", target.with_name(f"{target.name}.reason.json"))

    def _free_place(self, name: str, mark: str, same: Callable[[Path], bool]) -> Path:
        """`name` itself, or with a `mark` where another file than the same has that name."""
        target = self.folder / name
        if not target.exists() or same(target):
            return target
        suffix = suffix_of(name)
        return self.folder / f"{name[: len(name) - len(suffix)]}-{mark}{suffix}"

    @staticmethod
    def _holds(source: Path, sha256: str, on_progress: ProgressCallback, there: Path) -> bool:
        """Return True if a file holds the same as the source; one of another size is not read."""
        if there.stat().st_size != source.stat().st_size:
            return False
        return checksum(there, on_progress) == sha256


def inode_identity(status: os.stat_result) -> str:
    """Return what tells one file of a folder from a later one of the same name and contents."""
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


def _copy_hashed(
    reading: BinaryIO, target: Path, most_bytes: int, on_progress: ProgressCallback
) -> tuple[str, int]:
    """Copies no more than a chunk beyond `most_bytes`, should the file grow."""
    digest, size, synced = hashlib.sha256(), 0, 0
    with target.open("wb") as writing:
        while size <= most_bytes and (chunk := reading.read(_CHUNK)):
            digest.update(chunk)
            size += len(chunk)
            writing.write(chunk)
            if size - synced >= _SYNC_BYTES:
                writing.flush()
                os.fdatasync(writing.fileno())
                synced = size
            on_progress()
        writing.flush()
        os.fsync(writing.fileno())
    return digest.hexdigest(), size


def _copy_whole(source: Path, target: Path, on_progress: ProgressCallback) -> None:
    temporary = target.with_name(f".{target.name}.part")
    temporary.unlink(missing_ok=True)
    with source.open("rb") as reading:
        _copy_hashed(reading, temporary, os.fstat(reading.fileno()).st_size, on_progress)
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


def disk_error(error: OSError, folder: Path) -> ShmError:
    if error.errno in DISK_FULL:
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
