"""The raw ring of permanent sensors: chunks, durable before they are acknowledged.

Beside the database and never in its way. Any process may append and read; only the holder of the
workspace's lock seals and sweeps.

What may leave the ring: the old, and the oldest where it grows too large.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from types import MappingProxyType

import numpy as np

from shm.bridge.streams import stream_named
from shm.documents import ValidationError, dump, format_time, value_of
from shm.errors import BadInput, DoubledChunk, StoreBusy
from shm.read.atomic import replace_text
from shm.read.chunk_document import chunk_document, numbered, parse_chunk, refuse_long_chunk
from shm.read.ring_segment import ChunkKey, microseconds, time_of
from shm.store.archive import disk_error, sync
from shm.store.ring_clock import was_ahead
from shm.store.ring_files import PERIOD, Segment, StreamFolder, checksum_of_chunk, log, period_of
from shm.store.ring_notices import DRIFT_PPM, StreamState, load_state
from shm.store.ring_pieces import agree, came_early, joined
from shm.store.ring_sealing import Note, seal_stream
from shm.store.workspace import Workspace
from shm.values.stream import Chunk, Piece, Stream


@dataclass(frozen=True)
class Swept:
    """Count the segments that were removed, and what is left in the ring.

    `unread_bytes` are of samples that the watch has not read, `recent_bytes` of the day before
    them, `kept_bytes` of what is kept for good: none of these is removed to meet a limit.
    """

    segments: int
    freed_bytes: int
    left_bytes: int
    unread_bytes: int = 0
    recent_bytes: int = 0
    kept_bytes: int = 0


def sweep(
    folders: Sequence[StreamFolder],
    now: datetime,
    longest: timedelta,
    most_bytes: int,
    unread: Mapping[str, Collection[datetime]],
    recent: timedelta = timedelta(days=1),
) -> Swept:
    """Remove segments older than `longest`, and the oldest beyond so many bytes.

    `unread` are the beginnings of the ten minutes that nobody has read, by stream. They stay, and
    so does what is `recent` before them or before now: an alert keeps it for good.
    """
    kept = {folder.folder: _kept(folder) for folder in folders}
    found = [
        (segment, segment.path.stat().st_size, folder)
        for folder in folders
        for segment in folder.segments()
    ]
    total = left = sum(size for _, size, _ in found)
    held_bytes = {"unread": 0, "recent": 0, "kept": 0}
    removed = 0
    for segment, size, folder in sorted(found, key=lambda each: each[0]):
        waiting = unread.get(folder.folder.name, ())
        is_old = segment.start + PERIOD <= now - longest
        since = min(waiting, default=now) - recent
        if segment.start in waiting:
            held_bytes["unread"] += size
        elif _is_kept(segment, kept[folder.folder]):
            held_bytes["kept"] += size
        elif segment.start >= since and not is_old:
            held_bytes["recent"] += size
        elif is_old or left > most_bytes:
            segment.path.unlink(missing_ok=True)
            left, removed = left - size, removed + 1
    for folder in folders:
        _remove_empty(folder)
    held = {f"{name}_bytes": size for name, size in held_bytes.items()}
    return Swept(removed, total - left, left, **held)


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


MOST_WAITING = 20_000
"""Judgement: chunks of a stream that are not sealed, a day of one every 4 s. Beyond, whoever seals
has ended, or cannot: senders, which keep what is not acknowledged, are held up."""

_TRIES = 5  # technical: a reader meets a sealing once in a while, and not again at once
_RATE_OFF = DRIFT_PPM * 1e-6
"""Of the described rate, within which a chunk is taken as of that rate. Derived: no frequency is
then further off than the setting frequency_allowance grants. Crystals keep to it: NI 9234, 50 ppm.
"""
_OVER_RANGE = 2.0
"""Of full_scale. Judgement: a sensor that clips at 5 V, before a converter that does at 10 V."""
_SWEEP = "last_sweep.json"
_UNFINISHED = timedelta(hours=1)  # technical: no file takes so long; a killed process left it


@dataclass(frozen=True)
class StoredChunk:
    """A chunk that is on disk; not `is_new` where it was there before."""

    stream: str
    sequence: int
    start: datetime
    end: datetime
    is_new: bool


class Ring:
    """All streams of a workspace, below `folder`.

    With `streams` only these are taken, as they are described; with `clock` nothing older than
    `late` and nothing further ahead than `ahead`. What is noticed goes to `note`.
    """

    def __init__(
        self,
        folder: Path,
        streams: Sequence[Stream] | None = None,
        clock: Callable[[], datetime] | None = None,
        *,
        late: timedelta = timedelta(hours=96),
        ahead: timedelta = timedelta(days=1),
        note: Note = lambda event: log.info("%s: %s: %s", event.stream, event.kind, event.detail),
    ):
        self.folder, self._streams, self._clock = folder, streams, clock
        self._late, self._ahead, self._note = late, ahead, note

    def append(self, content: bytes) -> StoredChunk:
        """Keeps a chunk: on disk when this returns. One that came before is not kept twice.

        Raises BadInput where it cannot be used, StoreError with `retry_after_s` where the disk is
        full, StoreBusy where too many wait.
        """
        return self.append_all([content])[0]

    def append_all(self, contents: Sequence[bytes], stream: str = "") -> list[StoredChunk]:
        """Several at once, which is quicker; where one cannot be used, none is kept.

        Raises DoubledChunk for one of the number and time of another that has other samples.

        `stream` is whose they must be, where that is known.
        """
        for content in contents:
            refuse_long_chunk(len(content))
        chunks = [self._fitting(parse_chunk(content), stream) for content in contents]
        try:
            placed = [self._place(chunk) for chunk in chunks]
            found = [self._kept(*each) for each in zip(chunks, placed, strict=True)]
            for name in {chunk.stream for chunk in chunks}:
                if (incoming := self._folder(name).incoming).is_dir():
                    sync(incoming)
        except OSError as error:
            raise disk_error(error, self.folder) from error
        return found

    def read(self, stream: str, start: datetime, end: datetime) -> tuple[Piece, ...]:
        """The samples from `start` on and before `end`, sealed and unsealed alike, by time."""
        folder = self._folder(stream)
        for left in reversed(range(_TRIES)):
            try:
                found = folder.between(start, end, folder.waiting())
            except FileNotFoundError:
                if not left:
                    raise
                continue
            break
        return joined({k: self._ordered(chunk) for k, chunk in found.items()}, start, end)

    def seal(self, now: datetime) -> list[tuple[str, datetime]]:
        """Chunks of finished ten minutes become segments; each stream and beginning of ten minutes
        that has new samples by it, also where some came late.
        """
        sealed: list[tuple[str, datetime]] = []
        try:
            for folder in self._folders():
                starts = seal_stream(folder, now, self._note)
                sealed.extend((folder.folder.name, start) for start in starts)
        except OSError as error:
            raise disk_error(error, self.folder) from error
        return sealed

    def keep(self, stream: str, start: datetime, end: datetime, why: str) -> None:
        """Keeps the samples of a time for good, for a reason."""
        kept = self._folder(stream).folder / "kept"
        kept.mkdir(parents=True, exist_ok=True)
        document = {"stream": stream, "start": start, "end": end, "why": why}
        path = kept / f"{microseconds(start):017d}-{microseconds(end):017d}.json"
        replace_text(path, dump(document) + "\n")
        for each in (path, kept, kept.parent):
            sync(each)

    def sweep(
        self,
        now: datetime,
        ring_days: float = 30,
        ring_bytes: int = 200 * 10**9,
        unread: Mapping[str, Collection[datetime]] = MappingProxyType({}),
    ) -> Swept:
        """Remove what is older than so many days, and the oldest beyond so many bytes.

        What is kept for good stays, and so do the `unread` ten minutes of each stream and the day
        before them. What was left is noted for `last_sweep`.
        """
        for folder in self._folders():
            folder.remove_unfinished(now - _UNFINISHED)
        longest = timedelta(days=ring_days)
        swept = sweep(list(self._folders()), now, longest, ring_bytes, unread)
        if self.folder.is_dir():
            replace_text(self.folder / _SWEEP, dump(asdict(swept)) + "\n")
        return swept

    def last_sweep(self) -> Swept | None:
        """Return what the last sweep left; None where there was none or its note is damaged."""
        try:
            return value_of(Swept, json.loads((self.folder / _SWEEP).read_text(encoding="utf-8")))
        except FileNotFoundError:
            return None
        except (ValidationError, ValueError) as error:
            log.warning("%s cannot be read: %s", self.folder / _SWEEP, error)
            return None

    def latest(self) -> dict[str, datetime]:
        """Return when the last sample of each stream ended."""
        ends = {folder.folder.name: self._recent(folder) for folder in self._folders()}
        return {name: time_of(max(e for _, e in spans)) for name, spans in ends.items() if spans}

    def last_arrivals(self) -> dict[str, datetime]:
        """Return when something of each stream last came, whatever the time of its samples."""
        found = {}
        for folder in self._folders():
            name = folder.folder.name
            times = [self.state(name).arrived]
            for each in folder.waiting():
                with suppress(FileNotFoundError):  # it has been sealed
                    times.append(each.arrived)
            if known := [each for each in times if each is not None]:
                found[name] = max(known)
        return found

    def periods(self, stream: str, since: datetime) -> tuple[datetime, ...]:
        """The beginnings of the ten minutes from `since` on that have sealed samples."""
        return tuple(self._folder(stream).periods(since))

    def unsealed_periods(self, stream: str) -> frozenset[datetime]:
        """Return the beginnings of the ten minutes of which chunks wait to be sealed."""
        waiting = self._folder(stream).waiting()
        return frozenset(period_of(each.key.start_us) for each in waiting)

    def state(self, stream: str) -> StreamState:
        """Return what is known of a stream from what is sealed."""
        return load_state(self._folder(stream).folder / "state.json")

    def size_bytes(self, stream: str) -> int:
        """Of all segments of a stream and of what waits."""
        folder = self._folder(stream)
        paths = [each.path for each in folder.segments()]
        paths += [each.path for each in folder.waiting()]
        return sum(path.stat().st_size for path in paths if path.exists())

    def _fitting(self, chunk: Chunk, stream: str) -> Chunk:
        if stream not in ("", chunk.stream):
            raise BadInput(
                f"a chunk of stream {chunk.stream} was sent as one of stream {stream[:64]!r}.",
                remedy="Name the same stream in the chunk and in the address.",
            )
        if self._streams is not None:
            described = stream_named(tuple(self._streams), chunk.stream)
            _refuse_other(chunk, described)
            chunk = replace(self._ordered(chunk), sampling_rate_hz=described.sampling_rate_hz)
        if self._clock is not None:
            _refuse_far(chunk, self._clock(), self._late, self._ahead)
        return chunk

    def _place(self, chunk: Chunk) -> tuple[Path, bytes] | None:
        """The file for a chunk, in the one form in which all are kept; None where its samples are
        there. Raises DoubledChunk, unless those that differ are of a clock that was ahead.
        """
        folder, content = self._folder(chunk.stream), chunk_document(chunk)
        key = ChunkKey(microseconds(chunk.start), chunk.sequence, checksum_of_chunk(content))
        path = folder.chunk_path(key, microseconds(chunk.end))
        if path.exists():
            return None
        others = [(other, self._ordered(each)) for other, each in folder.alike(key)]
        known = [each for _, each in others if agree(each, chunk)]
        if any(each.values.shape[1] >= chunk.values.shape[1] for each in known):
            return None
        differing = [other for other in others if not agree(other[1], chunk)]
        if differing and not self._is_of_clock_ahead(key, chunk, differing):
            raise _doubled(chunk)
        return path, content

    def _is_of_clock_ahead(
        self, key: ChunkKey, chunk: Chunk, differing: Sequence[tuple[ChunkKey, Chunk]]
    ) -> bool:
        """Return True if a clock that was ahead dated all of the chunks that differ from one."""
        folder = self._folder(chunk.stream)
        if self._clock is not None:
            arrived_us = microseconds(self._clock())
            if came_early(replace(key, arrived_us=arrived_us), chunk):
                return False
        known = self.state(chunk.stream).step_times
        return all(was_ahead(folder, known, each, chunk) for each in differing)

    def _kept(self, chunk: Chunk, placed: tuple[Path, bytes] | None) -> StoredChunk:
        if placed is not None:
            folder = self._folder(chunk.stream)
            folder.make()
            self._refuse_crowd(folder)
            self._write(*placed)
        is_new = placed is not None
        return StoredChunk(chunk.stream, chunk.sequence, chunk.start, chunk.end, is_new)

    def _write(self, path: Path, content: bytes) -> None:
        temporary = path.with_name(f".{path.name}.{os.getpid()}.{id(content)}.part")
        try:
            with temporary.open("wb") as file:
                file.write(content)
                file.flush()
                if self._clock is not None:
                    at = self._clock().timestamp()
                    os.utime(file.fileno(), (at, at))
                os.fsync(file.fileno())
            temporary.rename(path)
        finally:
            temporary.unlink(missing_ok=True)

    def _refuse_crowd(self, folder: StreamFolder) -> None:
        if sum(1 for _ in folder.incoming.iterdir()) >= MOST_WAITING:
            raise StoreBusy(
                f"{MOST_WAITING} chunks of stream {folder.folder.name} wait to be sealed.",
                remedy="Look whether the daemon runs: `shm doctor`. Then send them again.",
                retry_after_s=30.0,
            )

    def _recent(self, folder: StreamFolder) -> set[tuple[int, int]]:
        """Start and end of the chunks of the last segments and of those that wait."""
        spans = {(each.key.start_us, each.end_us) for each in folder.waiting()}
        for segment in folder.last_segments():
            ends = folder.spans(segment.path)
            spans |= {(key.start_us, end_us) for key, end_us in ends.items()}
        return spans

    def _ordered(self, chunk: Chunk) -> Chunk:
        """With the channels in the order in which they are described."""
        described = next((s for s in self._streams or () if s.name == chunk.stream), None)
        names = tuple(each.name for each in described.channels) if described else chunk.channels
        if names == chunk.channels or set(names) != set(chunk.channels):
            return chunk
        places = [chunk.channels.index(name) for name in names]
        return replace(chunk, channels=names, values=chunk.values[places])

    def _folder(self, stream: str) -> StreamFolder:
        return StreamFolder(self.folder / stream)

    def _folders(self) -> Iterator[StreamFolder]:
        for path in sorted(self.folder.glob("*")):
            if path.is_dir():
                yield StreamFolder(path)


def ring_of(
    workspace: Workspace, clock: Callable[[], datetime] | None = None, note: Note | None = None
) -> Ring:
    """The ring of a workspace, by its description and settings."""
    settings = workspace.settings
    ahead = timedelta(seconds=settings.future_tolerance_seconds)
    late = timedelta(hours=settings.late_hours)
    noting = {} if note is None else {"note": note}
    folder, streams = workspace.folder / "ring", workspace.bridge.streams
    return Ring(folder, streams, clock, late=late, ahead=ahead, **noting)


def _named(chunk: Chunk) -> str:
    return f"{numbered(chunk.sequence)} of stream {chunk.stream}"


def _doubled(chunk: Chunk) -> DoubledChunk:
    return DoubledChunk(
        f"{_named(chunk)} of {format_time(chunk.start)} is kept "
        "already, with other samples, which stay.",
        remedy="Send a chunk again unchanged only; send other samples under the next number and "
        "their own time, by a clock in UTC.",
    )


def _refuse_other(chunk: Chunk, stream: Stream) -> None:
    """Raises BadInput for a chunk that is not sampled as its stream is described."""
    missing = {channel.name for channel in stream.channels} ^ set(chunk.channels)
    rate = chunk.sampling_rate_hz
    if missing:
        raise BadInput(
            f"{_named(chunk)} has not the channels of bridge.toml: {', '.join(sorted(missing))}.",
            remedy="Send null for a sensor that is away, or correct [[stream.channel]].",
        )
    if abs(rate - stream.sampling_rate_hz) > _RATE_OFF * stream.sampling_rate_hz:
        raise BadInput(
            f"{_named(chunk)} has {rate:.10g} Hz where bridge.toml "
            f"says {stream.sampling_rate_hz:.10g}; {DRIFT_PPM:g} ppm of difference are taken.",
            remedy=f"Write sampling_rate_hz = {rate:.10g} there, or correct the logger.",
        )
    for channel in stream.channels:
        values = np.abs(chunk.values[chunk.channels.index(channel.name)])
        beyond = np.flatnonzero(values > _OVER_RANGE * channel.full_scale)  # none where unknown
        if len(beyond):
            raise BadInput(
                f"{_named(chunk)}: sample {beyond[0]} is "
                f"{values[beyond[0]]:g} m/s2 where full_scale is {channel.full_scale:g}.",
                channel=channel.name,
                remedy="Send m/s2, and null for what is no reading; or correct full_scale in "
                "bridge.toml.",
            )


def _refuse_far(chunk: Chunk, now: datetime, late: timedelta, ahead: timedelta) -> None:
    """Raises BadInput for samples that nobody waits for any more, and for those to come."""
    when = f"{_named(chunk)} is of {format_time(chunk.start)}"
    if chunk.end < now - late:
        raise BadInput(
            f"{when}, longer ago than the {late.total_seconds() / 3600:g} hours of late_hours.",
            remedy="Set the logger's clock, or raise the setting late_hours.",
        )
    if chunk.start > now + ahead:
        raise BadInput(f"{when}, which is to come.", remedy="Set the logger's clock.")
