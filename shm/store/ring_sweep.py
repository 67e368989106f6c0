"""What may leave the ring: the old, and the oldest where it grows too large."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from shm.read.ring_segment import time_of
from shm.store.ring_files import PERIOD, Segment, StreamFolder


@dataclass(frozen=True)
class Swept:
    """How many segments were taken out, and what is left."""

    segments: int
    freed_bytes: int
    left_bytes: int


def sweep(folders: Sequence[StreamFolder], before: datetime, most_bytes: int) -> Swept:
    """Takes out segments that ended before a time, and the oldest beyond so many bytes."""
    kept = {folder.folder: _kept(folder) for folder in folders}
    segments = sorted(segment for folder in folders for segment in folder.segments())
    found = [(segment, segment.path.stat().st_size) for segment in segments]
    total = left = sum(size for _, size in found)
    removed = 0
    for segment, size in found:
        if segment.start + PERIOD > before and left <= most_bytes:
            break
        if not _is_kept(segment, kept[segment.path.parent.parent]):
            segment.path.unlink(missing_ok=True)
            left, removed = left - size, removed + 1
    for folder in folders:
        _remove_empty(folder)
    return Swept(removed, total - left, left)


def _kept(folder: StreamFolder) -> list[tuple[datetime, datetime]]:
    names = (path.stem.split("-") for path in (folder.folder / "kept").glob("[0-9]*.json"))
    return [(time_of(int(start)), time_of(int(end))) for start, end in names]


def _is_kept(segment: Segment, kept: Sequence[tuple[datetime, datetime]]) -> bool:
    """A chunk that began in the segment may end as long after it as it is long."""
    return any(segment.start < end and segment.start + 2 * PERIOD > start for start, end in kept)


def _remove_empty(folder: StreamFolder) -> None:
    for day in folder.folder.glob("[0-9]*"):
        if not any(day.iterdir()):
            day.rmdir()
