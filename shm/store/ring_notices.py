"""Events of a stream noticed as its chunks are sealed: gaps, overlaps, clocks, late chunks."""

from __future__ import annotations

import json
import logging
from bisect import bisect_left, insort
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from shm.documents import ValidationError, dump, parse_time, value_of
from shm.read.atomic import replace_text
from shm.read.chunk_document import BY_TIME, numbered
from shm.read.ring_segment import ChunkKey, microseconds
from shm.store.ring_files import PERIOD
from shm.store.ring_pieces import slack_s
from shm.values.stream import Chunk, StreamEvent, StreamEventKind

log = logging.getLogger(__name__)

GRACE = timedelta(seconds=30)  # judgement: how long what is sent at once may be on its way
_FILE_LATE = timedelta(hours=25)  # judgement: a logger may roll its files once a day
_DRIFT_OVER_S = 6 * 3600.0  # derived: a jitter of 50 ms at both ends is then 5 ppm
DRIFT_PPM = 100.0  # as the setting frequency_allowance: every frequency is wrong by as much


@dataclass(frozen=True)
class PassedChunk:
    """Of a chunk what the next is compared with."""

    sequence: int
    start: datetime
    end: datetime
    sampling_rate_hz: float
    arrived: datetime

    @property
    def length_s(self) -> float:
        return (self.end - self.start).total_seconds()


@dataclass(frozen=True)
class StreamState:
    """The state of a stream: its last chunk, since when its samples have been counted without
    a break and how long they say that is, and of each ten minutes how many seconds of samples
    count, how many are kept apart, being of a time that was there before, which are the numbers of
    the first and the last chunk that belongs there, and when these begin and end. `steps` are
    when samples begin that were set aside because the clock was ahead, with by how many hours.
    `arrived` is when the last of all came, in whatever order of their times they came.
    """

    last: PassedChunk | None = None
    counted_since: datetime | None = None
    counted_s: float = 0.0
    received_s: dict[str, float] = field(default_factory=dict)
    apart_s: dict[str, float] = field(default_factory=dict)
    numbers: dict[str, tuple[int, int]] = field(default_factory=dict)
    spans: dict[str, tuple[datetime, datetime]] = field(default_factory=dict)
    steps: dict[str, int] = field(default_factory=dict)
    arrived: datetime | None = None

    @property
    def step_times(self) -> tuple[datetime, ...]:
        return tuple(time for time in map(parse_time, self.steps) if time is not None)


def load_state(path: Path) -> StreamState:
    """The state as it was kept; an empty one where there is none, or a damaged one."""
    try:
        return value_of(StreamState, json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return StreamState()
    except (ValidationError, ValueError) as error:
        log.warning("%s begins anew: %s", path, error)
        return StreamState()


def save_state(path: Path, state: StreamState) -> None:
    """Keeps the state; what it is worth after a power cut, the next chunks show."""
    replace_text(path, dump(asdict(state)) + "\n")


def notice(
    stream: str, state: StreamState, chunks: Iterable[PassedChunk]
) -> tuple[StreamState, list[StreamEvent]]:
    """Compare chunks, by time, with those before; return events and the state after them."""
    events: list[StreamEvent] = []
    late: list[PassedChunk] = []
    for chunk in chunks:
        if state.arrived is None or chunk.arrived > state.arrived:
            state = replace(state, arrived=chunk.arrived)
        due = _FILE_LATE if chunk.sequence >= BY_TIME else PERIOD + GRACE
        if chunk.arrived > chunk.end + due:
            late.append(chunk)
        if state.last is None or chunk.start >= state.last.start:
            events.extend(_between(stream, state.last, chunk))
            state, drift = _counted(stream, state, chunk)
            events.extend(drift)
        elif _is_next(state.last, chunk):
            events.append(_stepped(stream, state.last, chunk))
    if late:
        delay_h = max((each.arrived - each.end).total_seconds() for each in late) / 3600
        many = "1 chunk" if len(late) == 1 else f"{len(late)} chunks"
        text = f"{many} came up to {delay_h:.1f} hours late, now in place"
        last = max(each.end for each in late)
        events.append(StreamEvent(stream, "late", late[0].start, last, text))
    return state, events


def notice_overlap(
    new: Mapping[ChunkKey, Chunk], covered: Mapping[ChunkKey, int]
) -> list[StreamEvent]:
    """Return as one event what chunks have of a time that was there before they came."""
    found = [(chunk, covered[key]) for key, chunk in sorted(new.items()) if key in covered]
    if not found:
        return []
    first, last = found[0][0], found[-1][0]
    samples = sum(count for _, count in found)
    whose = numbered(first.sequence)
    if len(found) > 1:
        named = (
            f", {first.sequence} to {last.sequence}," if last.sequence < BY_TIME else " of files"
        )
        whose = f"{len(found)} chunks{named}"
    text = (
        f"{samples} samples of {whose} are of a time that was there already: the first to come "
        "count, these are kept apart; see to the logger's clock"
    )
    end = max(chunk.end for chunk, _ in found)
    return [_event(first.stream, "overlap", first.start, end, text)]


def notice_early(found: Mapping[ChunkKey, Chunk], keys: Collection[ChunkKey]) -> list[StreamEvent]:
    """Return an event of the chunks that came before their time, so that others count."""
    if not keys:
        return []
    early = [found[key] for key in sorted(keys)]
    text = (
        "the clock was ahead: samples came before the time they are dated; those that came in "
        "time count"
    )
    end = max(chunk.end for chunk in early)
    return [_event(early[0].stream, "clock step", early[0].start, end, text)]


def find_misplaced(
    new: Iterable[ChunkKey],
    others: Iterable[ChunkKey],
    numbers: Mapping[datetime, tuple[int, int]],
) -> dict[ChunkKey, tuple[int, int]]:
    """Return the new chunks whose number does not belong between its neighbours in time, and these.

    It belongs after both: the clock stepped back into a gap. A number below both may be of a logger
    that counts from the beginning again. Only neighbours that came earlier count. `numbers` are
    those of the first and the last chunk of ten minutes, by time.
    """
    asked = set(new)
    by_arrival = sorted({*asked, *others}, key=lambda key: (key.arrived_us, key.sequence, key))
    edges = ((at, at + PERIOD - timedelta(microseconds=1)) for at in numbers)
    ends = zip(edges, numbers.values(), strict=True)
    around = sorted((microseconds(at), n) for pair in ends for at, n in zip(*pair, strict=True))
    found = {}
    for key in by_arrival:
        if key.sequence >= BY_TIME:
            continue
        place = bisect_left(around, (key.start_us, key.sequence))
        if 0 < place < len(around):
            before, behind = around[place - 1][1], around[place][1]
            if before < behind <= key.sequence:
                if key in asked:
                    found[key] = before, behind
                continue
        insort(around, (key.start_us, key.sequence))
    return found


def notice_misplaced(
    stream: str, found: Mapping[ChunkKey, tuple[int, int]], chunks: Mapping[ChunkKey, Chunk]
) -> list[StreamEvent]:
    """Chunks that are stamped into a gap which is not theirs, as one event."""
    if not found:
        return []
    ours = [chunks[key] for key in sorted(found)]
    before, behind = found[min(found)]
    whose = " to ".join(dict.fromkeys(str(each.sequence) for each in (ours[0], ours[-1])))
    text = (
        f"chunk {whose} is stamped between chunks {before} and {behind}, where its number does not "
        "belong: the clock stepped into a gap, and these samples are of another time"
    )
    return [_event(stream, "clock step", ours[0].start, max(c.end for c in ours), text)]


def notice_missing(new: Mapping[ChunkKey, Chunk]) -> list[StreamEvent]:
    """Values that a logger says it has not, of each channel as one event.

    Of a channel without any the watch over the sensors says that it is dead.
    """
    if not new:
        return []
    chunks = [chunk for _, chunk in sorted(new.items())]
    first, end = chunks[0], max(chunk.end for chunk in chunks)
    events = []
    for place, channel in enumerate(first.channels):
        missing = sum(int(np.isnan(chunk.values[place]).sum()) for chunk in chunks)
        if 0 < missing < sum(chunk.values.shape[1] for chunk in chunks):
            text = f"{missing} samples have no value (null or NaN)"
            events.append(StreamEvent(first.stream, "gap", first.start, end, text, channel))
    return events


def notice_told(new: Mapping[ChunkKey, Chunk]) -> list[StreamEvent]:
    """Return events that loggers report of themselves or their sensors."""
    return [
        StreamEvent(chunk.stream, "logger", chunk.start, chunk.start, chunk.event)
        for _, chunk in sorted(new.items())
        if chunk.event
    ]


def _is_next(before: PassedChunk, chunk: PassedChunk) -> bool:
    return chunk.sequence == before.sequence + 1 and chunk.sequence < BY_TIME


def _slack_s(before: PassedChunk, chunk: PassedChunk) -> float:
    numbers = before.sequence, chunk.sequence
    return slack_s(*numbers, chunk.sampling_rate_hz, before.length_s)


def _between(stream: str, before: PassedChunk | None, chunk: PassedChunk) -> Iterator[StreamEvent]:
    if before is None:
        return
    off_s = (chunk.start - before.end).total_seconds()
    if abs(off_s) <= _slack_s(before, chunk):
        return
    if _is_next(before, chunk):
        yield _stepped(stream, before, chunk)
    elif off_s > 0:
        samples = round(off_s * chunk.sampling_rate_hz)
        text = f"{samples} samples are missing before {numbered(chunk.sequence)}"
        yield _event(stream, "gap", before.end, chunk.start, text)


def _stepped(stream: str, before: PassedChunk, chunk: PassedChunk) -> StreamEvent:
    off_s = (chunk.start - before.end).total_seconds()
    text = f"the clock jumped by {off_s:+.3f} s before chunk {chunk.sequence}, which is the next"
    if abs(off_s) > 1800 and abs(off_s - 3600 * round(off_s / 3600)) <= _slack_s(before, chunk):
        text += ": whole hours (daylight saving?)"
    return _event(stream, "clock step", before.end, chunk.start, text)


def _event(
    stream: str, kind: StreamEventKind, start: datetime, end: datetime, said: str
) -> StreamEvent:
    return StreamEvent(stream, kind, min(start, end), max(start, end), said)


def _counted(
    stream: str, state: StreamState, chunk: PassedChunk
) -> tuple[StreamState, list[StreamEvent]]:
    """The stamps beside the count of the samples, as long as chunks follow each other."""
    before, length_s, follows = state.last, chunk.length_s, False
    if before is not None and (_is_next(before, chunk) or chunk.sequence >= BY_TIME):
        off_s = abs((chunk.start - before.end).total_seconds())
        follows = off_s <= _slack_s(before, chunk)
    since = state.counted_since
    if not follows or since is None:
        return replace(state, last=chunk, counted_since=chunk.start, counted_s=length_s), []
    elapsed_s = (chunk.start - since).total_seconds()
    if elapsed_s < _DRIFT_OVER_S:
        return replace(state, last=chunk, counted_s=state.counted_s + length_s), []
    ppm = (state.counted_s - elapsed_s) / elapsed_s * 1e6
    begun = replace(state, last=chunk, counted_since=chunk.start, counted_s=length_s)
    if abs(ppm) <= DRIFT_PPM:
        return begun, []
    what = "more" if ppm > 0 else "fewer"
    text = f"{abs(ppm):.0f} ppm {what} samples came than the stamps say: frequencies are as wrong"
    return begun, [StreamEvent(stream, "clock drift", since, chunk.start, text)]
