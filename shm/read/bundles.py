"""Tests of several files: one .zip holds the files of one test, each with its sidecar.

A sidecar NAME.toml beside NAME.zip may say hanger, time and temperature of the whole test.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import TypeVar

from shm.errors import BadInput, UsageError
from shm.read.arrays import natural
from shm.read.atomic import replace_file
from shm.read.content import MOST_MEMBERS, checked_members, refusal, unpack, unpacking_folder
from shm.read.header import CHANNEL_KEYS, Header
from shm.read.limits import guarded, limits
from shm.read.sidecar import SIDECAR_SUFFIX, document_beside, sidecar_path, with_sidecar

SUFFIX = ".zip"
FIRST_DAY = (1980, 1, 1, 0, 0, 0)  # the earliest that ZIP knows, so that equal files pack alike
_UNIX, _PLAIN_FILE = 3, 0o100644 << 16  # PKWARE APPNOTE 4.4.2 and 4.4.15: rw-r--r--

T = TypeVar("T")


def holds_test(path: Path) -> bool:
    """Whether a name is that of an archive with the files of one test."""
    return path.suffix.lower() == SUFFIX


@contextmanager
def unpacked(path: Path) -> Iterator[tuple[Path, ...]]:
    """The recordings of an archive in a folder that lasts as long as the context, sidecars beside.

    Raises BadInput naming the member at fault.
    """
    members = checked_members(path)
    with unpacking_folder() as folder:
        with guarded(path, "the archive"), zipfile.ZipFile(path) as archive:
            files = _unpack_all(archive, members, folder)
        sidecars = {file for file in files if file.suffix == SIDECAR_SUFFIX}
        recordings = sorted(set(files) - sidecars, key=lambda file: natural(str(file)))
        _refuse_alone(sidecars, recordings, path)
        if not recordings:
            raise BadInput(
                "the archive holds no recording.",
                file=path,
                remedy="Pack the files of one test with `shm ingest --together`.",
            )
        yield tuple(recordings)


def each_member(path: Path, verb: Callable[[Path, str], T]) -> tuple[T, ...]:
    """What `verb` gives for each recording of an archive and its name to the outside."""
    with unpacked(path) as files:
        return tuple(verb(file, str(path / file.name)) for file in files)


def entries_of_test(path: Path) -> Header:
    """What the sidecar of the archive says of the whole test.

    Raises BadInput where it describes channels: each file's own sidecar does.
    """
    for key in document_beside(path).keys() & {"channel", *CHANNEL_KEYS}:
        raise BadInput(
            f"{key!r} is said of a whole test.",
            file=sidecar_path(path),
            remedy="Say hanger, time and temperature_c here; describe channels in a sidecar of"
            " each file in the archive.",
        )
    return with_sidecar(Header(path, {}), path)


def bundle(paths: Sequence[Path], archive: Path) -> Path:
    """Writes the files of one test, with their sidecars, to a .zip, whole or not at all.

    Gives the path of the archive.
    The same files give the same bytes: names are sorted, times fixed and nothing is compressed.
    Raises UsageError for two files of one name, an archive among them, or too many.
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
    """All members in one folder; raises BadInput where two have one name or all are too large."""
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
