"""Look through the spool, and decide which of its files are whole.

The spool is looked through with all its subfolders but `streams/`, where loggers roll their files:
see `streams`. Left alone are names that begin with a dot,
uploads under way (`.part`, `.tmp`, `.filepart`), sidecars, which wait for their file, and what is
no file or cannot be looked at: links, pipes, devices, folders of another user.
A file is whole once neither it nor its sidecar has changed for some seconds; an empty one, which
some loggers make first and fill later, is given ten times as long.

Where what comes over the network lands: whole and safe in the spool, for the daemon to take.

A file is written in `spool/.landing`, which the daemon does not look into, forced to disk, and only
then given its name, its sidecar first. What a killed process left there is removed after a day.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from shm.errors import BadInput
from shm.read import sidecar_path
from shm.read.sidecar import SIDECAR_SUFFIX, Described, sidecar_text
from shm.store.archive import (
    MODES_SUFFIX,
    checksum,
    refuse_oversize,
    safe_name,
    suffix_of,
    sync,
)

STREAMS = "streams"
"""The folder of the spool with the rolling files of permanent sensors."""
_UNDER_WAY = (".part", ".tmp", ".filepart")
LEFT_ALONE = (*_UNDER_WAY, SIDECAR_SUFFIX)
"""Endings of names that are not taken by themselves."""
_PATIENCE_WITH_EMPTY = 10.0  # judgement: times as long: some loggers open a file before they write


@dataclass(frozen=True, order=True)
class Look:
    """State of a file and its sidecar from outside: when changed and how large."""

    modified_ns: int
    size_bytes: int
    sidecar_modified_ns: int = 0
    sidecar_size_bytes: int = 0


def scan(spool: Path, on_progress: Callable[[], object] = lambda: None) -> dict[Path, Look]:
    """The files of the spool that may become recordings; calls `on_progress` at each."""
    found = {}
    for path in _entries(spool):
        on_progress()
        if not path.name.lower().endswith(LEFT_ALONE):
            look = _look(path)
            if look is not None:
                found[path] = look
    return found


def is_sidecar(path: Path) -> bool:
    """Return True if a name is that of a sidecar, which waits for its file."""
    return path.name.lower().endswith(SIDECAR_SUFFIX)


def unfinished_uploads(spool: Path) -> list[Path]:
    """Uploads that are not finished, and sidecars whose file is not there."""
    files = [path for path in _entries(spool) if isinstance(_lying(path), os.stat_result)]
    awaited = {sidecar_path(path) for path in files if not is_sidecar(path)}
    return [
        path
        for path in files
        if path.name.lower().endswith(_UNDER_WAY) or (is_sidecar(path) and path not in awaited)
    ]


def unsupported_entries(spool: Path) -> dict[Path, str]:
    """Return the entries of the spool that will never be taken, by what they are."""
    unlisted: dict[Path, str] = {}

    def note(error: OSError) -> None:
        unlisted[Path(error.filename)] = f"a folder that cannot be listed ({error.strerror})"

    lying = {path: _lying(path) for path in _entries(spool, note)}
    return unlisted | {path: what for path, what in lying.items() if isinstance(what, str)}


def _entries(
    spool: Path, note: Callable[[OSError], object] = lambda _error: None
) -> Iterator[Path]:
    """All but folders whose name does not begin with a dot, also of subfolders; links to folders
    are entries, and are not gone into.
    """
    for folder, subfolders, names in os.walk(spool, onerror=note):
        others = {STREAMS} if Path(folder) == spool else set()
        subfolders[:] = [n for n in subfolders if not n.startswith(".") and n not in others]
        links = [name for name in subfolders if Path(folder, name).is_symlink()]
        for name in (*links, *names):
            if not name.startswith("."):
                yield Path(folder, name)


_KINDS = (
    (stat.S_ISLNK, "a link"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISDIR, "a folder"),
)


def _lying(path: Path) -> os.stat_result | str | None:
    """The status of a regular file, else what it is; None where it is gone.

    Whatever befalls one file, the others are seen.
    """
    try:
        status = path.lstat()
    except FileNotFoundError:
        return None
    except OSError as error:
        return f"a file that cannot be looked at ({error.strerror})"
    if stat.S_ISREG(status.st_mode):
        return status
    return next((kind for is_one, kind in _KINDS if is_one(status.st_mode)), "a device")


def _look(path: Path) -> Look | None:
    """None for what is no regular file, or was one a moment ago."""
    status = _lying(path)
    if not isinstance(status, os.stat_result):
        return None
    try:
        sidecar = sidecar_path(path).lstat()
    except FileNotFoundError:
        return Look(status.st_mtime_ns, status.st_size)
    return Look(status.st_mtime_ns, status.st_size, sidecar.st_mtime_ns, sidecar.st_size)


class FileStabilityTracker:
    """Tells which files have stopped changing, by looks handed in and a clock that only goes on."""

    def __init__(self, stable_s: float, clock: Callable[[], float]):
        self._stable_s, self._clock = stable_s, clock
        self._seen: dict[Path, tuple[Look, float]] = {}
        self._put_off: dict[Path, float] = {}
        self._left: dict[Path, Look] = {}

    def whole(self, looks: Mapping[Path, Look]) -> list[Path]:
        """Return those of the files that are whole, the oldest first."""
        now = self._clock()
        known, self._seen = self._seen, {}
        self._left = {path: look for path, look in self._left.items() if looks.get(path) == look}
        looks = {path: look for path, look in looks.items() if path not in self._left}
        for path, look in looks.items():
            before, since = known.get(path, (look, now))
            self._seen[path] = look, since if before == look else now
        self._put_off = {p: t for p, t in self._put_off.items() if p in looks and t > now}
        ready = [path for path in looks if self._whole_at(path) <= now]
        return sorted(ready, key=lambda path: (looks[path], path))

    def put_off(self, path: Path, seconds: float) -> None:
        """Leaves a file that could not be taken alone for a while."""
        self._put_off[path] = self._clock() + seconds

    def leave(self, path: Path) -> None:
        """Leaves a file that was refused, and cannot be moved away, until it changes."""
        self._left[path], _ = self._seen.pop(path)

    def forget(self, path: Path) -> None:
        """A file was taken."""
        self._seen.pop(path, None)

    @property
    def watching(self) -> bool:
        """Return True if any file is yet to be taken."""
        return bool(self._seen)

    def seconds_to_next(self) -> float:
        """Return how long until the next file may be whole; infinite without files."""
        if not self._seen:
            return float("inf")
        return max(0.0, min(map(self._whole_at, self._seen)) - self._clock())

    def _whole_at(self, path: Path) -> float:
        look, since = self._seen[path]
        patience = 1.0 if look.size_bytes else _PATIENCE_WITH_EMPTY
        return max(since + patience * self._stable_s, self._put_off.get(path, 0.0))


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
        """Return where the file lies, forced to disk, until it lands or is closed."""
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
        """Return True if the same bytes wait already under that name, with the same sidecar."""
        existing = sidecar_path(target)
        try:
            if target.stat().st_size != self.size_bytes:
                return False
            content = existing.read_bytes() if existing.exists() else b""
            ours = sidecar.read_bytes() if sidecar is not None else b""
            return content == ours and checksum(target) == self.sha256
        except OSError:
            return False

    def _placed(self, target: Path, sidecar: Path | None) -> bool:
        """Return True if the place was free, of the file and of its sidecar, and is ours now."""
        target_sidecar = sidecar_path(target)
        if target.exists() or target_sidecar.exists():
            return False
        if sidecar is not None and not _named(sidecar, target_sidecar):
            return False
        if _named(self._path, target):
            return True
        if sidecar is not None:
            target_sidecar.unlink(missing_ok=True)
        return False


def incoming(spool: Path, max_bytes: int) -> closing[Incoming]:
    """A file under way that leaves nothing behind where it does not land."""
    return closing(Incoming(spool, max_bytes))


def _places(spool: Path, name: str, sha256: str) -> Iterator[Path]:
    """The name itself, then with a piece of the checksum, then with pieces of chance."""
    size = len(last := suffix_of(name))
    if name.lower().endswith(MODES_SUFFIX):
        size = len(MODES_SUFFIX)
    elif last == ".gz":  # the ending before it as well
        size += len(suffix_of(name[:-size]))
    stem, suffix = name[: len(name) - size], name[len(name) - size :]
    yield spool / name
    yield spool / f"{stem}-{sha256[:8]}{suffix}"
    while True:
        yield spool / f"{stem}-{uuid.uuid4().hex[:12]}{suffix}"


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
