"""Chunks of finished ten minutes become a segment; a crash at any moment loses and doubles none.

The segment appears whole, under its name, before the chunks go. A chunk that is found in it the
next time was left by a crash, or came again, and goes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from shm.documents import format_time
from shm.errors import BadInput
from shm.read.atomic import replace_file
from shm.read.ring_segment import ChunkKey, write_segment
from shm.store.archive import sync
from shm.store.ring_files import PERIOD, StreamFolder, WaitingChunk, period_of
from shm.store.ring_notices import (
    GRACE,
    PassedChunk,
    StreamState,
    load_state,
    notice,
    save_state,
)
from shm.values.stream import Chunk, StreamEvent

_QUIET = timedelta(seconds=10)  # technical: a segment is not written anew for each late chunk
_RECEIVED_KEPT = timedelta(hours=25)  # of the share that was lost in a day

Note = Callable[[StreamEvent], object]


def seal_stream(folder: StreamFolder, now: datetime, note: Note) -> list[datetime]:
    """Seals what is finished of a stream; the beginnings of the ten minutes that have new samples.

    What is noticed is noted before the chunks go.
    """
    finished = _finished(folder.waiting(), now)
    if not finished:
        return []
    path = folder.folder / "state.json"
    state, sealed = load_state(path), []
    for start, waiting in finished:
        state, has_new = _seal(folder, start, waiting, state, note)
        if has_new:
            sealed.append(start)
    oldest = format_time(now - _RECEIVED_KEPT) or ""
    save_state(
        path,
        replace(state, received_s={k: s for k, s in state.received_s.items() if k >= oldest}),
    )
    return sealed


def _finished(
    waiting: Sequence[WaitingChunk], now: datetime
) -> list[tuple[datetime, list[WaitingChunk]]]:
    """The ten minutes that are over and get no chunk just now, by time, with their chunks."""
    found: defaultdict[datetime, list[WaitingChunk]] = defaultdict(list)
    for chunk in waiting:
        found[period_of(chunk.key.start_us)].append(chunk)
    return [
        (start, chunks)
        for start, chunks in sorted(found.items())
        if start + PERIOD + GRACE <= now
        and all(abs(now - _arrived(chunk)) >= _QUIET for chunk in chunks)
    ]


def _arrived(chunk: WaitingChunk) -> datetime:
    return datetime.fromtimestamp(chunk.path.stat().st_mtime, UTC)


def _seal(
    folder: StreamFolder,
    start: datetime,
    waiting: Sequence[WaitingChunk],
    state: StreamState,
    note: Note,
) -> tuple[StreamState, bool]:
    by_segment: defaultdict[Path, dict[ChunkKey, Chunk]] = defaultdict(dict)
    arrived = {each.key: _arrived(each) for each in waiting}
    for each in waiting:
        chunk = folder.load(each)
        if chunk is not None:
            by_segment[folder.segment_path(chunk)][each.key] = chunk
    has_new, received_s = False, 0.0
    for path, chunks in by_segment.items():
        known = folder.chunks(path) if path.exists() else {}
        new = _without_doubled(folder, waiting, known, chunks, note)
        passed = [_passed(chunk, arrived[key]) for key, chunk in sorted(new.items())]
        state, events = notice(folder.folder.name, state, passed)
        for event in events:
            note(event)
        if new:
            _write(path, known | new)
            has_new = True
        received_s += sum(map(_seconds, (known | new).values()))
    for each in waiting:
        each.path.unlink(missing_ok=True)  # what was damaged is set aside already
    if by_segment:
        sums = {**state.received_s, format_time(start) or "": received_s}
        state = replace(state, received_s=sums)
    return state, has_new


def _without_doubled(
    folder: StreamFolder,
    waiting: Sequence[WaitingChunk],
    known: Mapping[ChunkKey, Chunk],
    chunks: Mapping[ChunkKey, Chunk],
    note: Note,
) -> dict[ChunkKey, Chunk]:
    """What is new; of two chunks of one number and time that differ, the first counts."""
    new: dict[ChunkKey, Chunk] = {}
    seen = {(key.start_us, key.sequence) for key in known}
    for each in waiting:
        key, chunk = each.key, chunks.get(each.key)
        if chunk is None or key in known:
            continue
        if (key.start_us, key.sequence) in seen:
            said = f"chunk {key.sequence} came twice, with other samples; the first counts"
            note(StreamEvent(chunk.stream, "doubled", chunk.start, chunk.end, said))
            folder.set_aside(each.path, BadInput(said))
            continue
        seen.add((key.start_us, key.sequence))
        new[key] = chunk
    return new


def _write(path: Path, chunks: dict[ChunkKey, Chunk]) -> None:
    is_new = not path.parent.is_dir()
    path.parent.mkdir(exist_ok=True)
    replace_file(path, partial(write_segment, chunks=sorted(chunks.items())))
    sync(path.parent)
    if is_new:
        sync(path.parent.parent)


def _passed(chunk: Chunk, arrived: datetime) -> PassedChunk:
    return PassedChunk(chunk.sequence, chunk.start, chunk.end, chunk.sampling_rate_hz, arrived)


def _seconds(chunk: Chunk) -> float:
    return float(chunk.values.shape[1] / chunk.sampling_rate_hz)
