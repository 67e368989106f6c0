"""Tests of several files: one .zip holds the files of one test, each with its sidecar.

A sidecar NAME.toml beside NAME.zip may say hanger, time and temperature of the whole test, and of
all its files the rate and what their channels are. What the app phyphox exports is such a test of
one file.
"""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import TypeVar

from shm.errors import BadInput, UsageError
from shm.read.arrays import natural_sort_key
from shm.read.atomic import replace_file
from shm.read.content import (
    FIRST_DAY,
    MOST_MEMBERS,
    checked_members,
    holds_test,
    refusal,
    unpack,
    unpacking_folder,
)
from shm.read.header import CHANNEL_KEYS, Entry, Header
from shm.read.limits import guarded, limits
from shm.read.sidecar import (
    SIDECAR_SUFFIX,
    sidecar_document,
    sidecar_path,
    sidecar_text,
    with_sidecar,
)
from shm.read.stamps import moment

_OF_EACH = ("channel", "sampling_rate_hz")
_DEVICE, _CLOCK = "meta/device.csv", "meta/time.csv"
_MOST_CLOCK = 10_000  # judgement: bytes; it holds a line for each start and pause
_UNIX, _PLAIN_FILE = 3, 0o100644 << 16  # PKWARE APPNOTE 4.4.2 and 4.4.15: rw-r--r--

T = TypeVar("T")


@contextmanager
def unpacked(path: Path) -> Iterator[tuple[Path, ...]]:
    """Unpack the recordings of an archive, sidecars beside, for as long as the context lasts.

    What the archive's sidecar says of channels goes into that of each. Raises BadInput naming the
    member at fault.
    """
    members = [member for member in checked_members(path) if not _is_of_phyphox(member.filename)]
    with unpacking_folder() as folder:
        with guarded(path, "the archive"), zipfile.ZipFile(path) as archive:
            files = _unpack_all(archive, members, folder)
        sidecars = {file for file in files if file.suffix == SIDECAR_SUFFIX}
        recordings = sorted(set(files) - sidecars, key=lambda file: natural_sort_key(str(file)))
        _refuse_alone(sidecars, recordings, path)
        if not recordings:
            raise BadInput(
                "the archive holds no recording.",
                file=path,
                remedy="Pack the files of one test with `shm ingest --together`.",
            )
        shared = {key: v for key, v in sidecar_document(path).items() if key in _OF_EACH}
        for file in recordings if shared else ():
            of_file = sidecar_document(file)
            tables = {**shared.get("channel", {}), **of_file.get("channel", {})}
            text = sidecar_text({**shared, **of_file, "channel": tables})
            sidecar_path(file).write_text(text, encoding="utf-8")
        yield tuple(recordings)


def _is_of_phyphox(name: str) -> bool:
    """Return whether a member is what the app phyphox says of phone and clock."""
    return PurePosixPath(name.replace("\\", "/")).as_posix() in (_DEVICE, _CLOCK)


def _start_of_phyphox(path: Path) -> dict[str, Entry]:
    """Return the time at which the app phyphox began to record; empty for other archives."""
    with guarded(path, "the archive"), zipfile.ZipFile(path) as archive:
        if _CLOCK not in archive.namelist() or archive.getinfo(_CLOCK).file_size > _MOST_CLOCK:
            return {}
        text = archive.read(_CLOCK).decode("utf-8", errors="replace")
    for cells in csv.reader(text.splitlines()):
        if cells and cells[0] == "START":
            stamp = cells[-1].replace("UTC+", "+").replace("UTC-", "-")
            found = moment("", stamp)
            return {} if found is None else {"time": Entry(found.isoformat(), path)}
    return {}


def each_member(path: Path, verb: Callable[[Path, str], T]) -> tuple[T, ...]:
    """Return the results of `verb` for each recording of an archive and its member name."""
    with unpacked(path) as files:
        return tuple(verb(file, str(path / file.name)) for file in files)


def entries_of_test(path: Path) -> Header:
    """Return the header that the sidecar of an archive gives for the complete test.

    Raises BadInput for lists of channel values, as their order is undefined in an archive.
    """
    for key in sidecar_document(path).keys() & {*CHANNEL_KEYS}:
        raise BadInput(
            f"{key!r} is said of a whole test.",
            file=sidecar_path(path),
            remedy="Say hanger, time and temperature_c here; describe channels by name, in tables"
            " [channel.NAME] that hold for all files in the archive.",
        )
    entries = _start_of_phyphox(path) if holds_test(path) else {}
    return with_sidecar(Header(path, {}, entries), path, of_channels=False)


def bundle(paths: Sequence[Path], archive: Path) -> Path:
    """Write the files of one test, with their sidecars, to a .zip, and return its path.

    The same files give the same bytes: names are sorted, times fixed, contents stored
    uncompressed. An interrupted write leaves no archive. Raises UsageError for two files of one
    name, an archive among them, or too many.
    """
    files = sorted({*paths, *(s for p in paths if (s := sidecar_path(p)).is_file() and s != p)})
    names = [file.name for file in files]
    doubled = next((name for name in names if names.count(name) > 1), None)
    if doubled is not None:
        raise UsageError(f"two of the files are called {doubled}.", remedy="Rename one of them.")
    if len(names) > MOST_MEMBERS or not paths or any(map(holds_test, files)):
        raise UsageError(
            f"{len(names)} files cannot be packed as one test.",
            remedy=f"Give 1 to {MOST_MEMBERS} recordings, none of them an archive.",
        )
    replace_file(archive, lambda temporary: _pack(sorted(files, key=lambda f: f.name), temporary))
    return archive


def _pack(files: Sequence[Path], target: Path) -> None:
    with zipfile.ZipFile(target, "w") as archive:
        for file in files:
            member = zipfile.ZipInfo(file.name, FIRST_DAY)
            member.create_system, member.external_attr = _UNIX, _PLAIN_FILE
            archive.writestr(member, file.read_bytes())


def _unpack_all(
    archive: zipfile.ZipFile, members: Sequence[zipfile.ZipInfo], folder: Path
) -> list[Path]:
    """Unpack all members into one folder and return their paths.

    Raises BadInput where two have one name or all are too large.
    """
    files: list[Path] = []
    left = limits().bytes_at_once
    for member in members:
        target = folder / PurePosixPath(member.filename.replace("\\", "/")).name
        if target in files:
            raise refusal(
                member.filename, "has the name of another one", Path(str(archive.filename))
            )
        left -= unpack(archive, member, target, left)
        files.append(target)
    return files


def _refuse_alone(sidecars: set[Path], recordings: Sequence[Path], path: Path) -> None:
    for alone in sorted(sidecars - {sidecar_path(recording) for recording in recordings}):
        raise refusal(alone.name, "describes a recording that the archive does not hold", path)
