"""Find samples of a logger whose clock was ahead by whole hours, and exclude them from the ring.

They are dated later than they were recorded, after a pause that is whole hours too long. Once the
clock is right again, true samples come for the same times, and differ. Then these count. Where the
clock was ahead for less than an hour, the right samples that follow cut the pause: then the order
in which the samples came shows it, ahead by whole hours and back by as many.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from statistics import median

from shm.documents import dump
from shm.read.atomic import replace_file, replace_text
from shm.read.chunk_document import chunk_document
from shm.read.ring_segment import ChunkKey, microseconds, time_of, write_segment
from shm.store.archive import sync
from shm.store.ring_files import PERIOD, StreamFolder, WaitingChunk, near_period, period_of
from shm.store.ring_pieces import came_early, contradicts
from shm.values.stream import PERIODS, Chunk, StreamEvent

_HOUR = PERIODS["hour"]


@dataclass(frozen=True)
class HourStep:
    """A clock that was `hours` ahead in what is dated from `start` on and before `end`.

    `last_end` is when the last of these samples ends; they came before `before_us`.
    """

    start: datetime
    end: datetime
    hours: int
    last_end: datetime
    before_us: int

    @property
    def words(self) -> str:
        hours = "1 hour" if self.hours == 1 else f"{self.hours} hours"
        return f"the clock was {hours} ahead (daylight saving?)"


@dataclass(frozen=True)
class Arrival:
    """Begin, end and arrival of a chunk, in microseconds since 1970."""

    start_us: int
    end_us: int
    arrived_us: int


def find_hour_step(
    spans: Sequence[Arrival],
    chunk: Arrival,
    known: Collection[datetime],
    tolerance: timedelta = timedelta(seconds=2),
) -> HourStep | None:
    """Return the step of a clock that was ahead before a chunk came; None where no pause shows it.

    `spans` are the chunks that came earlier, and `chunk` is one that contradicts them. The last
    pause of an hour or more before it must be whole hours longer than usual, with no sample from
    that much after it on. `known` are the beginnings of former steps.
    """
    by_time = sorted((each.start_us, each.end_us) for each in spans)
    pauses, until_us = [], None
    for start_us, end_us in by_time:
        if until_us is not None and start_us > until_us:
            pauses.append((until_us, start_us))
        until_us = max(end_us, until_us or end_us)
    long_us, slack_us = (
        each // timedelta(microseconds=1) for each in (_HOUR - tolerance, tolerance)
    )
    hour_us = long_us + slack_us
    usual = [b - a for a, b in pauses if slack_us < b - a < long_us]
    long = [(a, b) for a, b in pauses if b - a >= long_us and b < chunk.end_us]
    if until_us is None or not long:
        return None
    if any(abs(time_of(long[-1][1]) - each) < _HOUR for each in known):
        return None
    pause_us = long[-1][1] - long[-1][0]
    for usual_us in (0.0, float(median(usual or [0]))):
        hours = round((pause_us - usual_us) / hour_us)
        step_us = hours * hour_us
        is_whole = hours > 0 and abs(pause_us - usual_us - step_us) <= slack_us
        if is_whole and by_time[-1][0] < chunk.start_us + step_us:
            start, end = time_of(long[-1][1]), time_of(chunk.start_us + step_us)
            return HourStep(start, end, hours, time_of(until_us), chunk.arrived_us)
    return None


def find_return(
    spans: Sequence[Arrival],
    chunk: Arrival,
    known: Collection[datetime],
    tolerance: timedelta = timedelta(seconds=2),
) -> HourStep | None:
    """Return the step of a clock that was ahead and set back again before a chunk came, else None.

    In the order in which they came, samples must begin whole hours later than usual after those
    before them, and end that much, give or take half of it, after those that came next begin. Their
    true time must be free. `chunk` contradicts some of them; the rest is as in `find_hour_step`.
    """
    hour_us, slack_us = (each // timedelta(microseconds=1) for each in (_HOUR, tolerance))
    by_arrival = sorted((each.arrived_us, each.start_us, each.end_us) for each in spans)
    starts = [start_us for _, start_us, _ in by_arrival]
    jumps = [start_us - before[2] for before, start_us in zip(by_arrival, starts[1:], strict=False)]
    usual_us = median([each for each in jumps if slack_us < each < hour_us - slack_us] or [0])
    for first, jump_us in reversed(list(enumerate(jumps, start=1))):
        later = range(first + 1, len(starts))
        back = next((place for place in later if starts[place] < starts[first]), None)
        if back is None:
            continue
        last_us = max(end_us for _, _, end_us in by_arrival[first:back])
        is_known = any(abs(time_of(starts[first]) - each) < _HOUR for each in known)
        if is_known or not starts[first] - slack_us <= chunk.start_us < last_us:
            continue
        for extra_us in (jump_us, jump_us - usual_us):
            hours = round(extra_us / hour_us)
            step_us = hours * hour_us
            is_whole = hours > 0 and abs(extra_us - step_us) <= slack_us
            returns = abs(last_us - starts[back] - step_us) <= step_us / 2
            true_span = starts[first] - step_us, last_us - step_us
            if is_whole and returns and not _is_covered(true_span, spans):
                start, end = time_of(starts[first]), time_of(last_us)
                return HourStep(start, end, hours, end, by_arrival[back][0])
    return None


def _is_covered(span: tuple[int, int], others: Iterable[Arrival]) -> bool:
    """Return True if one of others has half of its length within a span."""
    return any(
        2 * (min(span[1], each.end_us) - max(span[0], each.start_us)) > each.end_us - each.start_us
        for each in others
    )


def was_ahead(
    folder: StreamFolder,
    known: Collection[datetime],
    earlier: tuple[ChunkKey, Chunk],
    chunk: Chunk,
) -> bool:
    """Return True if an earlier chunk of the same number and time was dated by a clock ahead."""
    if came_early(*earlier):
        return True
    arrival = Arrival(microseconds(chunk.start), microseconds(chunk.end), sys.maxsize)
    spans = [_arrival(*each) for each in _list_spans(folder, folder.waiting(), arrival.start_us)]
    if find_hour_step(spans, arrival, known) is not None:
        return True
    step = find_return(spans, arrival, known)
    return step is not None and earlier[0].arrived_us < step.before_us


def exclude_ahead(
    folder: StreamFolder,
    waiting: Sequence[WaitingChunk],
    finished: Iterable[tuple[datetime, Sequence[WaitingChunk]]],
    known: Collection[datetime],
) -> Iterator[tuple[HourStep, StreamEvent, Mapping[datetime, Sequence[ChunkKey]]]]:
    """Exclude the samples that a clock dated ahead, now that others came for their time.

    Yields each step, what to note of it, and the ten minutes with the chunks that leave them;
    these leave once it is noted, when the next step is asked for.
    """
    steps = set(known)
    for start, own in finished:
        near = near_period(waiting, start)
        if not folder.has_doubled_time(start, start + PERIOD, near):
            continue
        found = folder.between(start, start + PERIOD, near)
        of_period = {each.key for each in own}
        new = [key for key in found if key in of_period]
        for key in sorted(new, key=lambda each: (each.arrived_us, each)):
            earlier = [each for at, each in found.items() if at.arrived_us < key.arrived_us]
            if not any(contradicts(each, found[key]) for each in earlier):
                continue
            step = _find_step(folder, waiting, key, found[key], steps)
            if step is None:
                break
            steps.add(step.start)
            leaving = _list_excluded(folder, waiting, step)
            count = sum(len(keys) for keys in leaving.values())
            chunks = "1 chunk is" if count == 1 else f"{count} chunks are"
            text = f"{step.words}: {chunks} set aside; the samples that came later count"
            stream = folder.folder.name
            yield step, StreamEvent(stream, "clock step", step.start, step.last_end, text), leaving
            gone = {each for keys in leaving.values() for each in keys}
            _move_to_aside(folder, waiting, leaving, text)
            found = {each: chunk for each, chunk in found.items() if each not in gone}
            waiting = [each for each in waiting if each.key not in gone]


def _find_step(
    folder: StreamFolder,
    waiting: Sequence[WaitingChunk],
    key: ChunkKey,
    chunk: Chunk,
    known: Collection[datetime],
) -> HourStep | None:
    """Return the step that a chunk shows that contradicts what came earlier; None without any.

    Its clock was set back by the step, give or take half of it: no correction of seconds.
    """
    arrival = _arrival(key, microseconds(chunk.end))
    spans = [
        _arrival(each, end_us)
        for each, end_us in _list_spans(folder, waiting, arrival.start_us)
        if each.arrived_us < key.arrived_us
    ]
    step = find_hour_step(spans, arrival, known)
    if step is not None and step.last_end - chunk.start >= step.hours * _HOUR / 2:
        return step
    return find_return(spans, arrival, known)


def _arrival(key: ChunkKey, end_us: int) -> Arrival:
    return Arrival(key.start_us, end_us, key.arrived_us)


def _list_spans(
    folder: StreamFolder,
    waiting: Sequence[WaitingChunk],
    start_us: int,
    reach: timedelta = timedelta(hours=96),
) -> list[tuple[ChunkKey, int]]:
    """Return chunks around a time, each with its end: from `reach` before it on."""
    found: list[tuple[ChunkKey, int]] = []
    for segment in folder.segments(time_of(start_us) - reach):
        found += folder.spans(segment.path).items()
    for each in waiting:
        with suppress(FileNotFoundError):  # it has been sealed
            found.append((each.arrived_key, each.end_us))
    return found


def _list_excluded(
    folder: StreamFolder, waiting: Sequence[WaitingChunk], step: HourStep
) -> dict[datetime, list[ChunkKey]]:
    """Return the chunks that a step dates wrongly, by ten minutes."""
    since_us, until_us = microseconds(step.start), microseconds(step.end)
    keys = [each.arrived_key for each in waiting]
    for segment in folder.segments(period_of(since_us)):
        if segment.start < step.end:
            keys += folder.spans(segment.path)
    found: dict[datetime, list[ChunkKey]] = {}
    for key in sorted(set(keys)):
        if since_us <= key.start_us < until_us and key.arrived_us < step.before_us:
            found.setdefault(period_of(key.start_us), []).append(key)
    return found


def _move_to_aside(
    folder: StreamFolder,
    waiting: Sequence[WaitingChunk],
    leaving: Mapping[datetime, Sequence[ChunkKey]],
    reason: str,
) -> None:
    """Move chunks out of their segments and of what waits into `aside/`, each with the reason."""
    aside = folder.folder / "aside"
    aside.mkdir(exist_ok=True)
    for each in waiting:
        if each.key in leaving.get(period_of(each.key.start_us), ()):
            replace_text(aside / f"{each.path.name}.reason.json", dump({"message": reason}) + "\n")
            each.path.replace(aside / each.path.name)
    for start, keys in leaving.items():
        for path in folder.segments_at(start):
            chunks = folder.chunks(path)
            for key in chunks.keys() & set(keys):
                chunk = chunks.pop(key)
                name = folder.chunk_path(key, microseconds(chunk.end)).name
                replace_text(aside / f"{name}.reason.json", dump({"message": reason}) + "\n")
                (aside / name).write_bytes(chunk_document(chunk))
                sync(aside / name)
            sync(aside)
            if chunks:
                replace_file(path, partial(write_segment, chunks=sorted(chunks.items())))
            else:
                path.unlink()
            sync(path.parent)
