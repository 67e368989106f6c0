"""The folder of one stream in the ring: its files, their names, and what is set aside.

incoming/START-END-SEQUENCE-CHECKSUM.chunk     chunks as they came, until they are sealed
20260501/20260501T1210Z-LAYOUT.h5              ten minutes of them, by when they began
kept/START-END.json                            what is kept for good, and why
aside/                                         what is damaged, with its reason
state.json                                     what the next chunks are compared with
"""

from __future__ import annotations

import hashlib
import logging
import os
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from itertools import takewhile
from pathlib import Path

from shm.documents import dump
from shm.errors import BadInput
from shm.read.atomic import replace_text
from shm.read.chunk_document import parse_chunk
from shm.read.ring_segment import ChunkKey, microseconds, read_segment, read_spans, time_of
from shm.store.archive import sync
from shm.values.stream import Chunk

log = logging.getLogger(__name__)

PERIOD = timedelta(minutes=10)  # that of a window
_PERIOD_US = PERIOD // timedelta(microseconds=1)
_NAME = "%Y%m%dT%H%MZ"
_ROUNDING_US = 2  # technical: of two stamps
_SPANS_HELD = 1024  # technical: those around the last one of 100 streams, some 20 kB each


@dataclass(frozen=True, order=True)
class WaitingChunk:
    """A chunk that is on disk and not in a segment yet."""

    key: ChunkKey
    end_us: int
    path: Path

    @property
    def arrived(self) -> datetime:
        return datetime.fromtimestamp(self.path.stat().st_mtime, UTC)

    @property
    def arrived_key(self) -> ChunkKey:
        """Return the key with the time of arrival."""
        return replace(self.key, arrived_us=microseconds(self.arrived))


@dataclass(frozen=True, order=True)
class Segment:
    """A file of the chunks that began within ten minutes from `start` on."""

    start: datetime
    path: Path


def period_of(time_us: int) -> datetime:
    """Return when the ten minutes began that a time is in."""
    return time_of(time_us // _PERIOD_US * _PERIOD_US)


def near_period(waiting: Sequence[WaitingChunk], start: datetime) -> Sequence[WaitingChunk]:
    """Return those by which it is decided which samples count of what began in ten minutes."""
    low, high = (
        bisect_left(waiting, microseconds(time), key=lambda each: each.key.start_us)
        for time in (start - 3 * PERIOD, start + 4 * PERIOD)
    )
    return waiting[low:high]


def checksum_of_chunk(content: bytes) -> str:
    """64 bits of a SHA-256: two chunks of a stream have the same once in 2^64 times."""
    return hashlib.sha256(content).hexdigest()[:16]


class StreamFolder:
    """The files of one stream."""

    def __init__(self, folder: Path):
        self.folder, self.incoming = folder, folder / "incoming"

    def make(self) -> None:
        """Makes the folder, to outlast a power cut."""
        if not self.incoming.is_dir():
            self.incoming.mkdir(parents=True, exist_ok=True)
            for folder in (self.folder, self.folder.parent, self.folder.parent.parent):
                sync(folder)

    def chunk_path(self, key: ChunkKey, end_us: int) -> Path:
        """Return the path where a chunk waits."""
        name = f"{key.start_us:017d}-{end_us:017d}-{key.sequence}-{key.checksum}.chunk"
        return self.incoming / name

    def segment_path(self, chunk: Chunk) -> Path:
        """The segment for a chunk; one that is sampled otherwise has another."""
        start = period_of(microseconds(chunk.start))
        layout = hashlib.sha256(repr((chunk.channels, chunk.sampling_rate_hz)).encode())
        name = f"{start:{_NAME}}-{layout.hexdigest()[:8]}.h5"
        return self.folder / f"{start:%Y%m%d}" / name

    def waiting(self, pattern: str = "[0-9]*") -> list[WaitingChunk]:
        """The chunks that are not sealed, by time."""
        found = []
        for path in self.incoming.glob(f"{pattern}.chunk"):
            start_us, end_us, sequence, checksum = path.stem.split("-")
            key = ChunkKey(int(start_us), int(sequence), checksum)
            found.append(WaitingChunk(key, int(end_us), path))
        return sorted(found)

    def segments(self, since: datetime | None = None) -> Iterator[Segment]:
        """Yield the segments that began from a time on, by time."""
        for day, name in self._segment_names(since):
            yield Segment(_start_of(name), day / name)

    def periods(self, since: datetime | None = None) -> Iterator[datetime]:
        """Yield the beginnings of the ten minutes that have segments, from a time on."""
        names = (name.partition("-")[0] for _, name in self._segment_names(since))
        yield from map(_start_of, dict.fromkeys(names))

    def _segment_names(self, since: datetime | None) -> Iterator[tuple[Path, str]]:
        """Yield the day and the name of each segment from a time on, by time.

        Pages ask for thousands, and plain names are quicker than paths.
        """
        least = "" if since is None else f"{since.astimezone(UTC):{_NAME}}"
        for day in sorted(self.folder.glob("[0-9]*")):
            if day.name >= least[:8]:
                try:
                    names = sorted(os.listdir(day))  # noqa: PTH208 - no path of each is made
                except FileNotFoundError:  # it has become empty
                    continue
                for name in names:
                    if name >= least and name[0].isdigit() and name.endswith(".h5"):
                        yield day, name

    def segments_at(self, start: datetime) -> list[Path]:
        """Return those of the ten minutes from `start` on: one for each way to sample."""
        return sorted(self.folder.glob(f"{start:%Y%m%d}/{start:{_NAME}}-*.h5"))

    def between(
        self, start: datetime, end: datetime, waiting: Sequence[WaitingChunk]
    ) -> dict[ChunkKey, Chunk]:
        """The chunks that have samples within a time, sealed or among those that wait; where some
        are of one time, those of ten minutes around too, which tell what counts.

        `waiting` must have been looked up first: what is sealed meanwhile is in a segment then.
        """
        since, until = start - 3 * PERIOD, end + 2 * PERIOD
        near = list(takewhile(lambda segment: segment.start < until, self.segments(since)))
        spans = {s.path: [(k.start_us, e) for k, e in self.spans(s.path).items()] for s in near}
        spans[self.incoming] = [(each.key.start_us, each.end_us) for each in waiting]
        since_us, until_us = microseconds(start), microseconds(end)
        if _is_tangled(pair for some in spans.values() for pair in some):
            since_us, until_us = since_us - _PERIOD_US, until_us + _PERIOD_US
        found: dict[ChunkKey, Chunk] = {}
        for segment in near:
            if any(s < until_us and since_us < e for s, e in spans[segment.path]):
                found |= self.chunks(segment.path)
        for each in waiting:
            is_within = each.key.start_us < until_us and since_us < each.end_us
            if is_within and each.key not in found:
                key = each.arrived_key
                if (chunk := self.load(each)) is not None:
                    found[key] = chunk
        return found

    def alike(self, key: ChunkKey) -> Iterator[tuple[ChunkKey, Chunk]]:
        """Yield the chunks of the same number and beginning, sealed or not."""
        for each in self.waiting(f"{key.start_us:017d}-*-{key.sequence}-*"):
            with suppress(FileNotFoundError):  # it has been sealed
                arrived_key = each.arrived_key
                if (chunk := self.load(each)) is not None:
                    yield arrived_key, chunk
        same = key.start_us, key.sequence
        for path in self.segments_at(period_of(key.start_us)):
            if any((k.start_us, k.sequence) == same for k in self.spans(path)):
                found = self.chunks(path)
                yield from ((k, c) for k, c in found.items() if (k.start_us, k.sequence) == same)

    def has_doubled_time(
        self, start: datetime, end: datetime, waiting: Sequence[WaitingChunk]
    ) -> bool:
        """Return True if chunks within a time have half of one's length in common."""
        ends = {each.key: each.end_us for each in waiting}
        for segment in self.segments(start - PERIOD):
            if segment.start >= end:
                break
            ends |= self.spans(segment.path)
        since_us, until_us = microseconds(start), microseconds(end)
        last = 0, 0
        for span in sorted((key.start_us, end_us) for key, end_us in ends.items()):
            if span[0] < until_us and since_us < span[1]:
                common_us = min(span[1], last[1]) - span[0]
                if 2 * common_us >= min(span[1] - span[0], last[1] - last[0]) > 0:
                    return True
                last = max(last, span, key=lambda each: each[1])
        return False

    def last_segments(self) -> Iterator[Segment]:
        """Yield the segments of the last half hour that has any."""
        for day in sorted(self.folder.glob("[0-9]*"), reverse=True):
            names = [path.name for path in day.glob("[0-9]*.h5")]
            if names:
                return self.segments(_start_of(max(names)) - 2 * PERIOD)
        return iter(())

    def load(self, waiting: WaitingChunk) -> Chunk | None:
        """A chunk that is not sealed; None where it is damaged, which is set aside."""
        content = waiting.path.read_bytes()
        try:
            if checksum_of_chunk(content) != waiting.key.checksum:
                raise BadInput("the chunk is torn: its bytes are not those that came.")
            return parse_chunk(content)
        except BadInput as error:
            self.set_aside(waiting.path, error)
            return None

    def chunks(self, path: Path) -> dict[ChunkKey, Chunk]:
        """The chunks of a segment; none where it is damaged, which is set aside, or not there."""
        try:
            return read_segment(path)
        except BadInput as error:
            self._refuse(path, error)
            return {}

    def spans(self, path: Path) -> dict[ChunkKey, int]:
        """The same, but when each ended alone."""
        try:
            return _spans(path, path.stat().st_mtime_ns)
        except FileNotFoundError:
            return {}
        except BadInput as error:
            self._refuse(path, error)
            return {}

    def remove_unfinished(self, before: datetime) -> None:
        """Remove what a killed process left half written before a time."""
        for left in self.folder.glob("*/.*.part"):
            with suppress(FileNotFoundError):  # it has its name by now
                if left.stat().st_mtime < before.timestamp():
                    left.unlink()

    def _refuse(self, path: Path, error: BadInput) -> None:
        """Sets a segment aside, unless it is the machine that cannot read it."""
        if isinstance(error.__cause__, MemoryError):
            raise error
        try:
            path.read_bytes()
        except FileNotFoundError:
            return
        self.set_aside(path, error)

    def set_aside(self, path: Path, error: BadInput) -> None:
        """Lays a damaged file where nobody reads it, with the reason: the others go on."""
        aside = self.folder / "aside"
        aside.mkdir(exist_ok=True)
        log.error("%s is set aside: %s", path, error.message)
        replace_text(aside / f"{path.name}.reason.json", dump({"message": error.message}) + "\n")
        path.replace(aside / path.name)


def _start_of(name: str) -> datetime:
    """Return when a segment begins, by its name; ten times as quick as `strptime`."""
    parts = name[:4], name[4:6], name[6:8], name[9:11], name[11:13]
    return datetime(*map(int, parts), tzinfo=UTC)  # type: ignore[misc, arg-type]


def _is_tangled(spans: Iterable[tuple[int, int]]) -> bool:
    """Return True if two different spans, in microseconds, have more in common than rounding."""
    until_us = 0
    for start_us, end_us in sorted(set(spans)):
        if start_us < until_us - _ROUNDING_US:
            return True
        until_us = max(until_us, end_us)
    return False


@lru_cache(_SPANS_HELD)
def _spans(path: Path, _modified_ns: int) -> dict[ChunkKey, int]:
    return read_spans(path)
