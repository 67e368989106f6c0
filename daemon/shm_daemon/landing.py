"""Where what comes over the network lands: whole and safe in the spool, for the daemon to take.

A file is written in `spool/.landing`, which the daemon does not look into, forced to disk, and only
then given its name, its sidecar first. What a killed process left there is removed after a day.
"""

from __future__ import annotations

import hashlib
import os
import re
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from shm.errors import BadInput
from shm.read import sidecar_path
from shm.read.profiles import Described, sidecar_text
from shm.store.archive import (
    MODES_SUFFIX,
    checksum,
    refuse_oversize,
    safe_name,
    suffix_of,
    sync,
)
from shm_daemon.spool import LEFT_ALONE

_LEFTOVER_S = 86400.0  # judgement: a day; no sender that is cut off after a minute is at it still
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


@dataclass(frozen=True)
class Landed:
    """A file that is safe in the spool."""

    path: Path
    sha256: str
    size_bytes: int


def landing_name(given: str) -> str:
    """The last part of a given name, without anything that a file system or the spool minds.

    Raises BadInput where nothing is left, or where the spool would leave the name alone.
    """
    last = PurePosixPath(given.replace("\\", "/")).name
    name = safe_name(Path(_UNPRINTABLE.sub("", last).strip().lstrip(".")))
    if name in ("", "."):
        raise BadInput(f"{given!r} is no file name.", remedy="Give one such as hanger3.csv.")
    if name.lower().endswith(LEFT_ALONE):
        raise BadInput(
            f"{name!r} would lie in the spool for ever: such names are left alone there.",
            remedy="Give the name of the recording itself, such as hanger3.csv.",
        )
    return name


class Incoming:
    """A file under way: written piece by piece, then landed. Leave it with `close`."""

    def __init__(self, spool: Path, max_bytes: int):
        folder = spool / ".landing"
        folder.mkdir(exist_ok=True)
        _sweep(folder)
        self._spool, self._max_bytes = spool, max_bytes
        self._path = folder / f"{uuid.uuid4().hex}.part"
        self._file = self._path.open("xb")
        self._digest, self.size_bytes = hashlib.sha256(), 0

    @property
    def sha256(self) -> str:
        """Of what was written so far, as 64 hexadecimal digits."""
        return self._digest.hexdigest()

    def write(self, piece: bytes | bytearray) -> None:
        """Raises TooLarge before more is kept than is taken."""
        refuse_oversize(self.size_bytes + len(piece), self._max_bytes)
        self._file.write(piece)
        self._digest.update(piece)
        self.size_bytes += len(piece)

    def whole(self) -> Path:
        """Where the file lies, forced to disk, until it lands or is closed."""
        self._file.flush()
        os.fsync(self._file.fileno())
        return self._path

    def land(self, name: str, described: Described) -> Landed:
        """Gives the file its name in the spool, or one beside it where that is taken.

        After this it outlasts a crash and a power cut. Raises BadInput for a name that cannot be.
        """
        name = landing_name(name)
        self.whole()
        sidecar = self._sidecar(described)
        for target in _places(self._spool, name, self.sha256):
            if self._lies_there(target, sidecar):
                return Landed(target, self.sha256, self.size_bytes)
            if self._placed(target, sidecar):
                sync(self._spool)
                return Landed(target, self.sha256, self.size_bytes)
        raise AssertionError("there is always one more place")

    def close(self) -> None:
        """Removes what has not landed."""
        self._file.close()
        self._path.unlink(missing_ok=True)
        sidecar_path(self._path).unlink(missing_ok=True)

    def _sidecar(self, described: Described) -> Path | None:
        if not described:
            return None
        path = sidecar_path(self._path)
        with path.open("w", encoding="utf-8") as file:
            file.write(sidecar_text(described))
            file.flush()
            os.fsync(file.fileno())
        return path

    def _lies_there(self, target: Path, sidecar: Path | None) -> bool:
        """Whether the same bytes wait already under that name, with the same sidecar."""
        beside = sidecar_path(target)
        try:
            if target.stat().st_size != self.size_bytes:
                return False
            told = beside.read_bytes() if beside.exists() else b""
            ours = sidecar.read_bytes() if sidecar is not None else b""
            return told == ours and checksum(target) == self.sha256
        except OSError:
            return False

    def _placed(self, target: Path, sidecar: Path | None) -> bool:
        """Whether the place was free, of the file and of its sidecar, and is ours now."""
        beside = sidecar_path(target)
        if target.exists() or beside.exists():
            return False
        if sidecar is not None and not _named(sidecar, beside):
            return False
        if _named(self._path, target):
            return True
        if sidecar is not None:
            beside.unlink(missing_ok=True)
        return False


@contextmanager
def incoming(spool: Path, max_bytes: int) -> Iterator[Incoming]:
    """A file under way that leaves nothing behind where it does not land."""
    file = Incoming(spool, max_bytes)
    try:
        yield file
    finally:
        file.close()


def _places(spool: Path, name: str, sha256: str) -> Iterator[Path]:
    """The name itself, then with a piece of the checksum, then with pieces of chance."""
    suffix = MODES_SUFFIX if name.lower().endswith(MODES_SUFFIX) else _suffixes_of(name)
    stem = name[: len(name) - len(suffix)]
    yield spool / name
    yield spool / f"{stem}-{sha256[:8]}{suffix}"
    while True:
        yield spool / f"{stem}-{uuid.uuid4().hex[:12]}{suffix}"


def _suffixes_of(name: str) -> str:
    """The ending with that before `.gz`."""
    last = suffix_of(name)
    before = suffix_of(name[: len(name) - len(last)]) if last == ".gz" else ""
    return name[len(name) - len(before + last) :] if last else ""


def _named(source: Path, target: Path) -> bool:
    """Gives a file its name unless another has it."""
    try:
        target.hardlink_to(source)
    except FileExistsError:
        return False
    except OSError:  # some network and memory-stick file systems know no links
        if target.exists():
            return False
        source.rename(target)
        return True
    source.unlink()
    return True


def _sweep(folder: Path) -> None:
    oldest = time.time() - _LEFTOVER_S
    for left in folder.iterdir():
        try:
            if left.stat().st_mtime < oldest:
                left.unlink()
        except FileNotFoundError:
            continue
