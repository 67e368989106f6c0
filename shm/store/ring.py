"""The raw ring of permanent sensors: chunks, durable before they are acknowledged.

Beside the database and never in its way. Any process may append and read; only the holder of the
workspace's lock seals and sweeps. Whether a chunk counts is decided when it comes.

What may leave the ring: the old, and the oldest where it grows too large.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shm.bridge.streams import stream_named
from shm.documents import dump, format_time
from shm.errors import BadInput, DoubledChunk
from shm.read.atomic import replace_text
from shm.read.chunk_document import numbered, parse_chunk, refuse_long_chunk
from shm.store.archive import disk_error, sync
from shm.store.ring_chunks import (
    EARLY,
    GRACE,
    OVERLAP,
    agree,
    came_early,
    find_taken,
    join,
    list_events,
    repeats,
    runs_on,
)
from shm.store.ring_conversion import convert_former_files
from shm.store.ring_days import PERIOD_US, Row, StreamDays, query, row_of, size_of, writing
from shm.values.stream import PERIOD, Chunk, Piece, Stream, StreamEvent, microseconds, time_of

if TYPE_CHECKING:
    from shm.store.workspace import Workspace

log = logging.getLogger(__name__)

_RATE_OFF_PPM = 100.0
"""Of the described rate, within which a chunk is taken as of that rate. Derived: no frequency is
then further off than the setting frequency_allowance grants. Crystals keep to it: NI 9234, 50 ppm.
"""
_OVER_RANGE = 2.0
"""Of full_scale. Judgement: a sensor that clips at 5 V, before a converter that does at 10 V."""
_UNFINISHED_S = 3600.0  # technical: no file takes so long; a killed process left it
_QUIET = timedelta(seconds=10)  # technical: a window is not read again for each late chunk
_DAY = timedelta(days=1)

_LATEST_END = """SELECT MAX(end_us) FROM chunks
WHERE start_us >= (SELECT MAX(start_us) FROM chunks) - 2 * 600000000"""
_PERIODS = """WITH RECURSIVE found (period) AS (
SELECT (SELECT start_us / 600000000 FROM chunks
    WHERE start_us >= ? AND is_sealed AND excluded = '' ORDER BY start_us LIMIT 1)
UNION ALL
SELECT (SELECT start_us / 600000000 FROM chunks
    WHERE start_us >= (period + 1) * 600000000 AND is_sealed AND excluded = ''
    ORDER BY start_us LIMIT 1) FROM found WHERE period IS NOT NULL
) SELECT period FROM found WHERE period IS NOT NULL"""
"""From one ten minutes to the next, which passes over the other chunks in them."""

Note = Callable[[StreamEvent], object]


@dataclass(frozen=True)
class StoredChunk:
    """A chunk that is on disk; not `is_new` where it was there before."""

    stream: str
    sequence: int
    start: datetime
    end: datetime
    is_new: bool


@dataclass(frozen=True)
class ReceivedSamples:
    """Seconds of samples that count in ten minutes, of those that do not as their time was there
    already, and from when to when those that count last, None without any.
    """

    received_s: float
    apart_s: float
    start: datetime | None
    end: datetime | None


class Ring:
    """All streams of a workspace, below `folder`.

    With `streams` only these are taken, as they are described; with `clock` nothing older than
    `late` and nothing further ahead than `ahead`. Events are passed to `note`.
    """

    def __init__(
        self,
        folder: Path,
        streams: Sequence[Stream] | None = None,
        clock: Callable[[], datetime] | None = None,
        *,
        late: timedelta = timedelta(hours=96),
        ahead: timedelta = _DAY,
        note: Note = lambda event: log.info("%s: %s: %s", event.stream, event.kind, event.detail),
    ):
        self.folder, self._streams, self._clock = folder, streams, clock
        self._late, self._ahead, self._note = late, ahead, note

    def append(self, content: bytes) -> StoredChunk:
        """Store a chunk: on disk when this returns. One that came before is not stored twice.

        Raises BadInput where it cannot be used, StoreError with `retry_after_s` where the disk is
        full.
        """
        return self.append_all([content])[0]

    def append_all(self, contents: Sequence[bytes], stream: str = "") -> list[StoredChunk]:
        """Store several at once, which is quicker; where one cannot be used, none is stored.

        Raises DoubledChunk for one of the number and time of another that has other samples.

        `stream` is whose they must be, where that is known.
        """
        for content in contents:
            refuse_long_chunk(len(content))
        chunks = [self._fitting(parse_chunk(content), stream) for content in contents]
        now = self._clock() if self._clock is not None else datetime.now(UTC)
        return self.place([(chunk, microseconds(now)) for chunk in chunks])

    def place(
        self, arrived: Sequence[tuple[Chunk, int]], is_former: bool = False
    ) -> list[StoredChunk]:
        """Store chunks, each with when it came, in microseconds, and exclude what does not count.

        Those of a former ring are sealed, and none of them is refused.
        """
        try:
            for name in {chunk.stream for chunk, _ in arrived}:
                self._days(name).make()
            paths = {self._days(c.stream).path(microseconds(c.start)) for c, _ in arrived}
            with writing(paths) if paths else nullcontext():
                return [self._place(chunk, at_us, is_former) for chunk, at_us in arrived]
        except OSError as error:
            raise disk_error(error, self.folder) from error

    def read(self, stream: str, start: datetime, end: datetime) -> tuple[Piece, ...]:
        """Return the samples from `start` on and before `end`, sealed or not, by time."""
        days = self._days(stream)
        rows = days.between(microseconds(start), microseconds(end))
        chunks = [chunk for row in rows if not row.excluded and (chunk := days.load(row))]
        return join(map(self._ordered, chunks), start, end)

    def seal(self, now: datetime) -> list[tuple[str, datetime]]:
        """Note what came of finished ten minutes; return each stream and beginning of ten minutes
        that has new samples by it, also where some came late.
        """
        return [
            (days.folder.name, time_of(start_us))
            for days in self._all_days()
            for start_us in self._seal(days, now)
        ]

    def keep(self, stream: str, start: datetime, end: datetime, why: str) -> None:
        """Keep the samples of a time for good, for a reason."""
        folder = self._days(stream).folder / "kept"
        folder.mkdir(parents=True, exist_ok=True)
        document = {"stream": stream, "start": start, "end": end, "why": why}
        path = folder / f"{microseconds(start):017d}-{microseconds(end):017d}.json"
        replace_text(path, dump(document) + "\n")
        for each in (path, folder, folder.parent):
            sync(each)

    def sweep(
        self,
        now: datetime,
        ring_days: float = 30,
        ring_bytes: int = 200 * 10**9,
        unread: Mapping[str, Collection[datetime]] = MappingProxyType({}),
        recent: timedelta = _DAY,
    ) -> int:
        """Remove days older than so many days, and the oldest beyond a size; return how many.

        `unread` are the beginnings of the ten minutes that nobody has read, by stream. Their days
        stay, and so does what is `recent` before them or before now: an alert keeps it for good.
        What is kept for good stays.
        """
        found = [(path, days) for days in self._all_days() for path in days.paths()]
        sizes = {path: size_of(path) for path, _ in found}
        removed = 0
        for path, days in sorted(found, key=lambda each: each[0].name):
            start = _day_of(path)
            waiting = unread.get(days.folder.name, ())
            is_old = start + _DAY <= now - timedelta(days=ring_days)
            is_unread = any(start <= each < start + _DAY for each in waiting)
            is_recent = not is_old and start + _DAY > min(waiting, default=now) - recent
            if is_unread or is_recent or not (is_old or sum(sizes.values()) > ring_bytes):
                continue
            before = sizes[path]
            days.thin(path, _retained(days), may_go=start + _DAY < now - self._late)
            sizes[path] = size_of(path)
            removed += sizes[path] < before
        for days in self._all_days():
            for left in days.folder.glob(".*.part*"):
                with suppress(FileNotFoundError):
                    if left.stat().st_mtime < time.time() - _UNFINISHED_S:
                        left.unlink()
        return removed

    def latest(self) -> dict[str, datetime]:
        """Return when the last sample of each stream ended."""
        ends = {}
        for days in self._all_days():
            found = (query(path, _LATEST_END) for path in reversed(days.paths()))
            end_us = next((rows[0][0] for rows in found if rows and rows[0][0]), None)
            if end_us is not None:
                ends[days.folder.name] = time_of(int(end_us))
        return ends

    def last_arrivals(self) -> dict[str, datetime]:
        """Return when something of each stream last came, whatever the time of its samples."""
        found = {}
        for days in self._all_days():
            if paths := days.paths():
                since_us = microseconds(_day_of(paths[-1]) - self._late)
                sql = "SELECT MAX(arrived_us) FROM chunks"
                times = [row[0] for path in days.paths(since_us) for row in query(path, sql)]
                if known := [each for each in times if each is not None]:
                    found[days.folder.name] = time_of(max(known))
        return found

    def periods(self, stream: str, since: datetime) -> tuple[datetime, ...]:
        """Return the beginnings of the ten minutes from `since` on that have sealed samples."""
        since_us = -(-microseconds(since) // PERIOD_US) * PERIOD_US
        paths = self._days(stream).paths(since_us)
        return tuple(
            time_of(int(row[0]) * PERIOD_US) for p in paths for row in query(p, _PERIODS, since_us)
        )

    def unsealed_periods(self, stream: str) -> frozenset[datetime]:
        """Return the beginnings of the ten minutes of which chunks wait to be sealed."""
        return frozenset(time_of(row.period_us) for row in self._days(stream).unsealed())

    def received(self, stream: str, since: datetime) -> dict[datetime, ReceivedSamples]:
        """Return what is sealed of each ten minutes from a time on."""
        sql = (
            "SELECT start_us / 600000000 AS period, "
            "SUM((excluded = '') * MAX(valid - covered, 0) / sampling_rate_hz), "
            "SUM(covered / sampling_rate_hz), "
            "MIN(CASE WHEN excluded = '' THEN start_us END), "
            "MAX(CASE WHEN excluded = '' THEN end_us END) "
            "FROM chunks WHERE start_us >= ? AND is_sealed GROUP BY period"
        )
        since_us = microseconds(since)
        found = {}
        for path in self._days(stream).paths(since_us):
            for period, received_s, apart_s, *edges in query(path, sql, since_us):
                begin, end = (None if each is None else time_of(int(each)) for each in edges)
                at = time_of(int(period) * PERIOD_US)
                found[at] = ReceivedSamples(float(received_s), float(apart_s), begin, end)
        return found

    def size_bytes(self, stream: str) -> int:
        """Return the size of all days of a stream."""
        return sum(size_of(path) for path in self._days(stream).paths())

    def _seal(self, days: StreamDays, now: datetime) -> list[int]:
        stream, sealed = days.folder.name, []
        convert_former_files(self, days.folder)
        waiting = sorted(days.unsealed(), key=lambda row: row.start_us)
        last = self._last_sealed(days) if waiting else None
        for start_us, group in groupby(waiting, key=lambda row: row.period_us):
            rows = list(group)
            is_quiet = all(
                row.excluded or abs(now - time_of(row.arrived_us)) >= _QUIET for row in rows
            )
            if time_of(start_us) + PERIOD + GRACE > now or not is_quiet:
                continue
            events, last = list_events(stream, last, rows)
            for event in events:
                self._note(event)
            days.seal(rows)
            sealed.append(start_us)
        return sealed

    def _last_sealed(self, days: StreamDays) -> Row | None:
        where = (
            "is_sealed AND excluded = '' AND start_us = "
            "(SELECT MAX(start_us) FROM chunks WHERE is_sealed AND excluded = '')"
        )
        found = (days.rows([path], where) for path in reversed(days.paths()))
        return next((rows[-1] for rows in found if rows), None)

    def _place(self, chunk: Chunk, arrived_us: int, is_former: bool) -> StoredChunk:
        """Store a chunk unless it is there; what came first counts, if its clock was not ahead."""
        days, row = self._days(chunk.stream), row_of(chunk, arrived_us)
        made = StoredChunk(chunk.stream, chunk.sequence, chunk.start, chunk.end, is_new=False)
        around = days.between(row.start_us, row.end_us)
        namesakes = [
            each
            for each in around
            if (each.start_us, each.sequence) == (row.start_us, row.sequence)
        ]
        for same in namesakes:
            known = self._load(days, same)
            if known and same.samples >= row.samples and agree(known, chunk):
                return made
        covered, conflicts = self._compare(days, chunk, around)
        if conflicts and not came_early(row) and all(came_early(each) for each, _ in conflicts):
            days.exclude((each for each, _ in conflicts), EARLY)
            covered, conflicts = self._compare(days, chunk, days.between(row.start_us, row.end_us))
        is_doubled = any(each in namesakes for each, _ in conflicts)
        if is_doubled and not is_former:
            raise _doubled(chunk)
        if is_doubled or any(not runs_on(before, chunk) for _, before in conflicts):
            row = row._replace(covered=row.samples, excluded=OVERLAP)
        elif covered.all() and not conflicts:
            return made
        elif not namesakes:  # of one that has grown what was there is there no more
            row = row._replace(covered=int(covered.sum()))
        days.add(row._replace(is_sealed=int(is_former)), chunk)
        return replace(made, is_new=True)

    def _compare(
        self, days: StreamDays, chunk: Chunk, around: Sequence[Row]
    ) -> tuple[NDArray[np.bool_], list[tuple[Row, Chunk]]]:
        """Return a mask of the samples whose time is there, and the chunks that differ there."""
        covered = np.zeros(chunk.values.shape[1], bool)
        start_us, end_us = microseconds(chunk.start), microseconds(chunk.end)
        conflicts = []
        for row in around:
            common_us = min(row.end_us, end_us) - max(row.start_us, start_us)
            if row.excluded or common_us * chunk.sampling_rate_hz < 0.5e6:  # half a sample
                continue
            before = self._load(days, row)
            taken = find_taken(before, chunk) if before else slice(0, 0)
            covered[taken] = True
            if before and taken.stop and not repeats(before, chunk, taken):
                conflicts.append((row, before))
        return covered, conflicts

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

    def _ordered(self, chunk: Chunk) -> Chunk:
        """With the channels in the order in which they are described."""
        described = next((s for s in self._streams or () if s.name == chunk.stream), None)
        names = tuple(each.name for each in described.channels) if described else chunk.channels
        if names == chunk.channels or set(names) != set(chunk.channels):
            return chunk
        places = [chunk.channels.index(name) for name in names]
        return replace(chunk, channels=names, values=chunk.values[places])

    def _load(self, days: StreamDays, row: Row) -> Chunk | None:
        chunk = days.load(row)
        return None if chunk is None else self._ordered(chunk)

    def _days(self, stream: str) -> StreamDays:
        return StreamDays(self.folder / stream)

    def _all_days(self) -> Iterator[StreamDays]:
        for path in sorted(self.folder.glob("*")):
            if path.is_dir():
                yield StreamDays(path)


def _day_of(path: Path) -> datetime:
    return datetime.strptime(path.stem, "%Y%m%d").replace(tzinfo=UTC)


def _retained(days: StreamDays) -> list[tuple[int, int]]:
    """Return from when to when samples are kept for good, in microseconds."""
    names = (path.stem.split("-") for path in (days.folder / "kept").glob("[0-9]*.json"))
    return [(int(start), int(end)) for start, end in names]


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
    if abs(rate - stream.sampling_rate_hz) > 1e-6 * _RATE_OFF_PPM * stream.sampling_rate_hz:
        raise BadInput(
            f"{_named(chunk)} has {rate:.10g} Hz where bridge.toml "
            f"says {stream.sampling_rate_hz:.10g}; {_RATE_OFF_PPM:g} ppm of difference are taken.",
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
