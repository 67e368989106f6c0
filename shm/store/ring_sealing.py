"""Chunks of finished ten minutes become a segment; a crash at any moment loses and doubles none.

The segment appears whole, under its name, before the chunks go. A chunk that is found in it the
next time was left by a crash, or came again, and goes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np

from shm.documents import format_time, parse_time
from shm.errors import BadInput
from shm.read.atomic import replace_file
from shm.read.chunk_document import numbered
from shm.read.ring_segment import ChunkKey, time_of, write_segment
from shm.store.archive import sync
from shm.store.ring_clock import exclude_ahead
from shm.store.ring_files import PERIOD, StreamFolder, WaitingChunk, near_period, period_of
from shm.store.ring_notices import (
    GRACE,
    PassedChunk,
    StreamState,
    find_misplaced,
    load_state,
    notice,
    notice_early,
    notice_misplaced,
    notice_missing,
    notice_overlap,
    notice_told,
    save_state,
)
from shm.store.ring_pieces import Layout, agree, came_early, lay_out
from shm.values.stream import Chunk, StreamEvent

_QUIET = timedelta(seconds=10)  # technical: a segment is not written anew for each late chunk
_RECEIVED_KEPT = timedelta(hours=25)  # of the share that was lost in a day
_NUMBERS_KEPT = timedelta(hours=97)  # of what comes as late as `late_hours` has it

Note = Callable[[StreamEvent], object]


def seal_stream(folder: StreamFolder, now: datetime, note: Note) -> list[datetime]:
    """Seals what is finished of a stream; the beginnings of the ten minutes that have new samples.

    What is noticed is noted before the chunks go.
    """
    waiting = folder.waiting()
    finished = _finished(waiting, now)
    if not finished:
        return []
    path = folder.folder / "state.json"
    state, changed = _exclude_ahead(folder, waiting, finished, load_state(path), note)
    waiting, sealed = folder.waiting() if changed else waiting, changed
    beside = [each.arrived_key for each in waiting]
    for start, own in finished:
        near = near_period(waiting, start)
        state, has_new = _seal(folder, start, own, near, beside, state, note)
        if has_new and start not in sealed:
            sealed.append(start)
    oldest = format_time(now - _RECEIVED_KEPT) or ""
    received_s, apart_s = (
        {k: s for k, s in known.items() if k >= oldest}
        for known in (state.received_s, state.apart_s)
    )
    spans = {k: each for k, each in state.spans.items() if k >= oldest}
    oldest = format_time(now - _NUMBERS_KEPT) or ""
    numbers = {k: each for k, each in state.numbers.items() if k >= oldest}
    state = replace(state, received_s=received_s, apart_s=apart_s, numbers=numbers, spans=spans)
    save_state(path, state)
    return sealed


def _exclude_ahead(
    folder: StreamFolder,
    waiting: Sequence[WaitingChunk],
    finished: Sequence[tuple[datetime, Sequence[WaitingChunk]]],
    state: StreamState,
    note: Note,
) -> tuple[StreamState, list[datetime]]:
    """Exclude what a clock dated ahead; the state without it, and the ten minutes it leaves."""
    changed: list[datetime] = []
    for step, event, leaving in exclude_ahead(folder, waiting, finished, state.step_times):
        note(event)
        changed += leaving.keys()
        state = replace(state, steps={**state.steps, format_time(step.start) or "": step.hours})
        if state.last is not None and step.start <= state.last.start < step.end:
            state = replace(state, last=None, counted_since=None)
    for start in changed:
        name = format_time(start) or ""
        numbers = {k: each for k, each in state.numbers.items() if k != name}
        spans = {k: each for k, each in state.spans.items() if k != name}
        found = folder.between(start, start + PERIOD, ())
        own = [key for key in found if period_of(key.start_us) == start]
        state = _with_numbers(replace(state, numbers=numbers, spans=spans), start, own)
        state = _counting(state, start, lay_out(found), found)
    return state, sorted(set(changed))


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
        and all(abs(now - chunk.arrived) >= _QUIET for chunk in chunks)
    ]


def _seal(
    folder: StreamFolder,
    start: datetime,
    waiting: Sequence[WaitingChunk],
    near: Sequence[WaitingChunk],
    beside: Sequence[ChunkKey],
    state: StreamState,
    note: Note,
) -> tuple[StreamState, bool]:
    end = max(start + PERIOD, time_of(max(each.end_us for each in waiting)))
    # What was sealed with ten minutes before is in a segment by now.
    found = folder.between(start, end, [each for each in near if each.path.exists()])
    known = {key for path in folder.segments_at(start) for key in folder.spans(path)}
    new = {each.key for each in waiting if each.key in found} - known
    for doubled in _doubled(found, new):
        _set_doubled_aside(folder, waiting, found.pop(doubled), doubled, note)
        new.discard(doubled)
    chunks = {key: chunk for key, chunk in found.items() if key in new}
    passed = [_passed(chunk, time_of(key.arrived_us)) for key, chunk in sorted(chunks.items())]
    state, events = notice(folder.folder.name, state, passed)
    layout = lay_out(found)
    early = {key for key in layout.covered if came_early(key, found[key])}
    covered = {key: samples for key, samples in layout.covered.items() if key not in early}
    events += notice_overlap(chunks, covered) + notice_early(
        found, {key for key in early if period_of(key.start_us) == start}
    )
    events += notice_missing(chunks) + notice_told(chunks)
    others = {parse_time(k): each for k, each in state.numbers.items()}
    others.pop(start, None)
    free = chunks.keys() - layout.covered.keys()  # of those that overlap it is said already
    strays = find_misplaced(free, [*found, *beside], others)
    events += notice_misplaced(folder.folder.name, strays, chunks)
    for event in events:
        note(event)
    _write_all(folder, {k: c for k, c in found.items() if period_of(k.start_us) == start}, new)
    for each in waiting:
        each.path.unlink(missing_ok=True)  # what was damaged is set aside already
    own = [k for k in found if period_of(k.start_us) == start and k not in strays]
    state = _with_numbers(state, start, own)
    return _counting(state, start, layout, found), bool(new)


def _with_numbers(state: StreamState, start: datetime, own: Sequence[ChunkKey]) -> StreamState:
    """Return the state with the numbers of the first and the last chunk of ten minutes, by time."""
    if not own:
        return state
    ends = min(own).sequence, max(own).sequence
    return replace(state, numbers={**state.numbers, format_time(start) or "": ends})


def _doubled(found: Mapping[ChunkKey, Chunk], new: Set[ChunkKey]) -> list[ChunkKey]:
    """Of chunks of one number and time that differ, all but the first: two that came at the same
    moment were both taken.
    """

    def name(key: ChunkKey) -> tuple[int, int, bool]:
        # What came before its own time gives way to what came in time (`lay_out`).
        return key.start_us, key.sequence, came_early(key, found[key])

    seen = {name(key): chunk for key, chunk in found.items() if key not in new}
    by_arrival = sorted((k for k in found if k in new), key=lambda key: (key.arrived_us, key))
    return [
        key for key in by_arrival if not agree(seen.setdefault(name(key), found[key]), found[key])
    ]


def _set_doubled_aside(
    folder: StreamFolder, waiting: Sequence[WaitingChunk], chunk: Chunk, key: ChunkKey, note: Note
) -> None:
    text = f"{numbered(chunk.sequence)} came twice, with other samples; the first counts"
    note(StreamEvent(chunk.stream, "doubled", chunk.start, chunk.end, text))
    path = next(each.path for each in waiting if each.key == key)
    folder.set_aside(path, BadInput(text))


def _write_all(folder: StreamFolder, chunks: Mapping[ChunkKey, Chunk], new: Set[ChunkKey]) -> None:
    """Each segment that has new chunks."""
    by_segment: defaultdict[Path, dict[ChunkKey, Chunk]] = defaultdict(dict)
    for key, chunk in chunks.items():
        by_segment[folder.segment_path(chunk)][key] = chunk
    for path, whole in by_segment.items():
        if not new.isdisjoint(whole):
            _write(path, whole)


def _counting(
    state: StreamState, start: datetime, layout: Layout, found: Mapping[ChunkKey, Chunk]
) -> StreamState:
    """With what came of ten minutes: samples that any channel has, once each."""
    name = format_time(start) or ""
    received_s = apart_s = 0.0
    own = [part for key, part in layout.parts if period_of(key.start_us) == start]
    for part in own:
        came = int((~np.isnan(part.values).all(axis=0)).sum())
        received_s += came / part.sampling_rate_hz
    for key, samples in layout.covered.items():
        if period_of(key.start_us) == start:
            apart_s += samples / found[key].sampling_rate_hz
    sums = {**state.received_s, name: received_s}
    apart = {**state.apart_s, name: apart_s} if apart_s else state.apart_s
    if not own:
        return replace(state, received_s=sums, apart_s=apart)
    span = min(part.start for part in own), max(part.end for part in own)
    spans = {**state.spans, name: span}
    return replace(state, received_s=sums, apart_s=apart, spans=spans)


def _write(path: Path, chunks: dict[ChunkKey, Chunk]) -> None:
    is_new = not path.parent.is_dir()
    path.parent.mkdir(exist_ok=True)
    replace_file(path, partial(write_segment, chunks=sorted(chunks.items())))
    sync(path.parent)
    if is_new:
        sync(path.parent.parent)


def _passed(chunk: Chunk, arrived: datetime) -> PassedChunk:
    return PassedChunk(chunk.sequence, chunk.start, chunk.end, chunk.sampling_rate_hz, arrived)
