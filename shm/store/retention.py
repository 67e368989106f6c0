"""Second copies of raw files, and what may leave the archive for having one.

A copy counts only if it is another file than the one here and has its SHA-256 at the moment of the
removal; that it was noted once is not enough. Rows and results always stay.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from shm.errors import NothingThere, StoreError
from shm.store.archive import Archive, is_whole
from shm.store.backups import Tell, file_troubles
from shm.store.recordings import list_recordings
from shm.store.rows import Stage, StoredRecording
from shm.store.store import Store
from shm.store.upkeep import list_copies

_ENDED = (Stage.DONE, Stage.REFUSED)
# Why an old raw file stays.
_NO_COPY = "no copy is noted"
_COPY_LOST = "no noted copy is whole"
_SHARED = "another recording needs its file"
_UNDER_WAY = "not through yet"


@dataclass(frozen=True)
class CopiedArchive:
    """Outcome of copying an archive: files copied now and before, and those that failed."""

    copied: int
    present: int
    missing: tuple[str, ...]
    damaged: tuple[str, ...]

    @property
    def troubles(self) -> tuple[str, ...]:
        return file_troubles(self.missing, self.damaged)


@dataclass(frozen=True)
class Removal:
    """The raw files of one recording that may go, by their path in the archive."""

    recording: StoredRecording
    names: tuple[str, ...]
    size_bytes: int
    copy_folder: str


@dataclass(frozen=True)
class Retention:
    """Files that may go, and of those old enough how many stay for which reason."""

    removals: tuple[Removal, ...]
    retained: Mapping[str, int]

    @property
    def size_bytes(self) -> int:
        return sum(removal.size_bytes for removal in self.removals)


def copy_archive(
    source: Archive, target: Archive, names: Collection[str], tell: Tell
) -> CopiedArchive:
    """Copies files of one archive, by their path in it, into another; what is there stays.

    Raises ShmError with `retry_after_s` where the disk is full.
    """
    target.folder.mkdir(parents=True, exist_ok=True)
    copied, present = 0, 0
    missing, damaged = [], []
    for number, name in enumerate(names, start=1):
        if _has(target, source, name):
            present += 1
        elif not (source.folder / name).is_file():
            missing.append(name)
        elif target.keep(source.folder / name, follow=True).archived_as == name:
            copied += 1
        else:  # it went to where its content belongs, which is not where its name says
            damaged.append(name)
        tell("archive", number / len(names))
    return CopiedArchive(copied, present, tuple(missing), tuple(damaged))


def removable(store: Store, archive: Archive, before: datetime, tell: Tell) -> Retention:
    """The raw files here of recordings that were received before a time and may go."""
    folders = _folders(store)
    everything = list_recordings(store)
    old = [each for each in everything if each.received_at < before and archive.holds(each.file)]
    retained: Counter[str] = Counter()
    found: dict[int, str] = {}
    for number, recording in enumerate(old, start=1):
        copy_folder = _copy(archive, recording, folders[recording.id])
        if recording.stage not in _ENDED:
            retained[_UNDER_WAY] += 1
        elif copy_folder is None:
            retained[_COPY_LOST if folders[recording.id] else _NO_COPY] += 1
        else:
            found[recording.id] = copy_folder
        tell("archive", number / len(old))
    needed = {name for each in everything if each.id not in found for name in _names(each)}
    removals = []
    for recording in old:
        if recording.id in found and recording.file.archived_as in needed:
            retained[_SHARED] += 1
        elif recording.id in found:
            names = tuple(name for name in _names(recording) if name not in needed)
            size = sum(_size(archive.folder / name) for name in names)
            removals.append(Removal(recording, names, size, found[recording.id]))
    return Retention(tuple(removals), dict(retained))


def remove(store: Store, archive: Archive, removals: Iterable[Removal], at: datetime) -> int:
    """Takes raw files out of the archive; how many bytes that freed.

    Each is noted in the store before it goes. One whose copy has vanished since, or that is being
    done again, is left alone.
    """
    freed = 0
    for removal in removals:
        ended = store.recordings.get(removal.recording.id).stage in _ENDED
        if not ended or _copy(archive, removal.recording, [removal.copy_folder]) is None:
            continue
        store.upkeep.note_removed(removal.recording, removal.copy_folder, at)
        for name in removal.names:
            path = archive.folder / name
            freed += _size(path)
            path.unlink(missing_ok=True)
    return freed


def fetch(store: Store, archive: Archive, recording: StoredRecording) -> str:
    """Copies a recording's raw files back into the archive; the folder that they came from.

    Raises NothingThere where no copy was noted, StoreError where none is whole.
    """
    folders = _folders(store)[recording.id]
    if not folders:
        raise NothingThere(
            f"no copy of {recording.file.file_name} is noted.", remedy="Drop the file again."
        )
    for folder in folders:
        if all(is_whole(Path(folder) / name) for name in _names(recording)):
            for name in _names(recording):
                archive.keep(Path(folder) / name, follow=True)
            return folder
    raise StoreError(
        f"no whole copy of {recording.file.file_name} is in {', '.join(folders)}.",
        remedy="Connect the disk with the copies, or drop the file again.",
    )


def _has(target: Archive, source: Archive, name: str) -> bool:
    """Files appear in an archive whole or not at all, so one of the right size is the right one."""
    path, original = target.folder / name, source.folder / name
    if not path.is_file():
        return False
    return not original.is_file() or original.stat().st_size == path.stat().st_size


def _folders(store: Store) -> defaultdict[int, list[str]]:
    """Return where copies of each recording were noted, the newest first."""
    found: defaultdict[int, list[str]] = defaultdict(list)
    for copy in reversed(list_copies(store)):
        found[copy.recording_id].append(copy.folder)
    return found


def _names(recording: StoredRecording) -> tuple[str, ...]:
    given = (recording.file.archived_as, recording.file.sidecar_as)
    return tuple(name for name in given if name is not None)


def _copy(archive: Archive, recording: StoredRecording, folders: Iterable[str]) -> str | None:
    """The first folder with a whole copy of all files of a recording."""
    for folder in folders:
        pairs = [(Path(folder) / name, archive.folder / name) for name in _names(recording)]
        if pairs and all(_is_copy(copy, original) for copy, original in pairs):
            return folder
    return None


def _is_copy(copy: Path, original: Path) -> bool:
    """Return True if a file has the SHA-256 that it is named by, and is not `original` itself."""
    try:
        if original.exists() and copy.samefile(original):
            return False  # a link to what would be deleted is no copy of it
    except OSError:
        return False
    return is_whole(copy)


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
