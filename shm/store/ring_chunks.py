"""Compare chunks with those that came before them, note what is odd, and join them to pieces.

Whatever stamps say to the millisecond. Where two chunks are of one time, the samples of the one
that came first count, unless its clock was ahead.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from shm.read.chunk_document import BY_TIME, numbered
from shm.store.ring_days import Row
from shm.values import NAN
from shm.values.stream import PERIOD, Chunk, Piece, StreamEvent, StreamEventKind, time_of

_JITTER_S = 0.05  # judgement: of a logger's stamps; a radio clock or NTP is within 10 ms
_DRIFT = 1e-3  # judgement: no crystal is further off; a long chunk differs by that from its stamps
_AHEAD_US = 60_000_000  # judgement: of the server's clock, which may be off as well
_OF_A_SAMPLE = 0.501  # derived: up to half a sample, and a stamp's microsecond, is the same sample


def slack_s(before: int, sequence: int, sampling_rate_hz: float, length_s: float) -> float:
    """Return the largest offset between stamps of two chunks that follow without a gap, in s.

    Where their numbers follow, no sample is missing between them: then it is a matter of stamps.
    Numbers that were made of the time cannot tell; there as much as jitter may be missing unseen.
    """
    sample_s = 1 / sampling_rate_hz
    if sequence == before + 1 or min(before, sequence) >= BY_TIME:
        return max(_JITTER_S, 1.5 * sample_s) + _DRIFT * length_s
    return _OF_A_SAMPLE * sample_s


def agree(one: Chunk, other: Chunk) -> bool:
    """Return True if two chunks have the same samples, as far as both have any."""
    samples = min(one.values.shape[1], other.values.shape[1])
    first, second = one.values[:, :samples], other.values[:, :samples]
    return _have_same_channels(one, other) and np.array_equal(first, second, equal_nan=True)


def find_taken(before: Chunk, chunk: Chunk) -> slice:
    """Return which samples of a chunk are of the time of another one, beyond jitter."""
    rate = chunk.sampling_rate_hz
    begin, end = max(before.start, chunk.start), min(before.end, chunk.end)
    common_s = (end - begin).total_seconds()
    first, second = (before, chunk) if before.start <= chunk.start else (chunk, before)
    slack = slack_s(first.sequence, second.sequence, rate, _seconds(first))
    is_jitter = common_s <= slack and not _ends_as_begins(first, second, round(common_s * rate))
    if common_s <= 0 or is_jitter:
        return slice(0, 0)
    return slice(*(round((time - chunk.start).total_seconds() * rate) for time in (begin, end)))


def repeats(before: Chunk, chunk: Chunk, taken: slice) -> bool:
    """Return True if the samples of the common time are the same, as of a logger that resends."""
    first = round((chunk.start - before.start).total_seconds() * chunk.sampling_rate_hz)
    there = before.values[:, first + taken.start : first + taken.stop]
    return _have_same_channels(before, chunk) and np.array_equal(
        there, chunk.values[:, taken], equal_nan=True
    )


def runs_on(before: Chunk, chunk: Chunk) -> bool:
    """Return True if a chunk is the next one, of a clock that was set back a little.

    Files are not counted.
    """
    numbers = before.sequence, chunk.sequence
    is_next = numbers[1] == numbers[0] + 1 or min(numbers) >= BY_TIME
    return is_next and before.start <= chunk.start


def came_early(row: Row) -> bool:
    """Return True if a chunk came before it ends by its stamps: its clock was ahead."""
    return row.end_us - row.arrived_us > _AHEAD_US


def join(chunks: Iterable[Chunk], start: datetime, end: datetime) -> tuple[Piece, ...]:
    """Return the samples from `start` on and before `end` of chunks that count, without overlaps.

    Where two of them are of one time they agree, or the next of a clock that was set back runs on.
    """
    runs: list[list[Chunk]] = []
    for chunk in sorted(chunks, key=lambda each: (each.start, each.sequence)):
        last = runs[-1][-1] if runs else None
        if last is not None and (taken := find_taken(last, chunk)).stop:
            later = chunk.start + timedelta(seconds=taken.stop / chunk.sampling_rate_hz)
            chunk = replace(chunk, start=later, values=chunk.values[:, taken.stop :])
            if not chunk.values.shape[1]:
                continue
        if last is not None and _have_same_channels(last, chunk):
            numbers = last.sequence, chunk.sequence
            slack = slack_s(*numbers, chunk.sampling_rate_hz, _seconds(last))
            if (chunk.start - last.end).total_seconds() <= slack:
                runs[-1].append(chunk)
                continue
        runs.append([chunk])
    pieces = (_cut(_piece(run), start, end) for run in runs)
    return tuple(piece for piece in pieces if piece.values.shape[1])


def _ends_as_begins(first: Chunk, second: Chunk, samples: int) -> bool:
    """Return True if so many samples at a seam are there twice, to the bit."""
    if samples < 1 or not _have_same_channels(first, second):
        return False
    tail, head = first.values[:, -samples:], second.values[:, :samples]
    is_telling = len(np.unique(tail)) > tail.size / 2
    return is_telling and np.array_equal(tail, head, equal_nan=True)


def _seconds(chunk: Chunk) -> float:
    return (chunk.end - chunk.start).total_seconds()


def _have_same_channels(one: Chunk, other: Chunk) -> bool:
    rates = one.sampling_rate_hz, other.sampling_rate_hz
    return one.channels == other.channels and rates[0] == rates[1]


def _piece(run: Sequence[Chunk]) -> Piece:
    first = run[0]
    values = np.concatenate([chunk.values for chunk in run], axis=1, dtype=float)
    weather = (_middle_c(run), _mean_wind_m_s(run))
    rate, start = first.sampling_rate_hz, first.start
    return Piece(first.stream, start, rate, first.channels, values, *weather)


def _middle_c(run: Sequence[Chunk]) -> float:
    """Return the median: a mean would make a likely temperature of 10 °C and a broken -127."""
    known = sorted(c.temperature_c for c in run if not math.isnan(c.temperature_c))
    return known[len(known) // 2] if known else NAN


def _mean_wind_m_s(run: Sequence[Chunk]) -> float:
    """Return the mean over the chunks that state it, each by its length."""
    known = [(c.wind_m_s, c.values.shape[1]) for c in run if not math.isnan(c.wind_m_s)]
    weights = sum(weight for _, weight in known)
    return sum(value * weight for value, weight in known) / weights if weights else NAN


def _cut(piece: Piece, start: datetime, end: datetime) -> Piece:
    rate, samples = piece.sampling_rate_hz, piece.values.shape[1]
    first, last = (_place((time - piece.start).total_seconds() * rate) for time in (start, end))
    first, last = max(first, 0), max(min(last, samples), 0)
    later = piece.start + timedelta(seconds=first / rate)
    return replace(piece, start=later, values=piece.values[:, first:last])


def _place(samples: float) -> int:
    """Return the first sample from a time on; a microsecond of rounding is no sample."""
    return math.ceil(samples - 1e-3)


GRACE = timedelta(seconds=30)  # judgement: how long what is sent at once may be on its way
_FILE_LATE = timedelta(hours=25)  # judgement: a logger may roll its files once a day

OVERLAP = "its time was there already"
EARLY = (
    "the clock was ahead: samples came before the time they are dated; those that came in time "
    "count"
)


def list_events(
    stream: str, last: Row | None, rows: Sequence[Row]
) -> tuple[list[StreamEvent], Row | None]:
    """Compare chunks, by time, with those before; return events and the last that counts."""
    events: list[StreamEvent] = []
    for row in (row for row in rows if not row.excluded):
        if last is None or row.start_us >= last.start_us:
            events += [] if last is None else _between(stream, last, row)
            last = row
        elif _is_next(last, row):
            events.append(_stepped(stream, last, row))
    for note in (_note_late, _note_overlap, _note_early, _note_missing, _note_loggers):
        events += note(stream, rows)
    return events, last


def _between(stream: str, before: Row, row: Row) -> Iterator[StreamEvent]:
    offset_s = _offset_s(before, row)
    if abs(offset_s) <= _slack_s(before, row):
        return
    if _is_next(before, row):
        yield _stepped(stream, before, row)
    elif offset_s > 0:
        samples = round(offset_s * row.sampling_rate_hz)
        text = f"{samples} samples are missing before {numbered(row.sequence)}"
        edges = time_of(before.end_us), time_of(row.start_us)
        yield StreamEvent(stream, "gap", *edges, text)


def _stepped(stream: str, before: Row, row: Row) -> StreamEvent:
    offset_s = _offset_s(before, row)
    text = f"the clock jumped by {offset_s:+.3f} s before chunk {row.sequence}, which is the next"
    off_hours_s = abs(offset_s - 3600 * round(offset_s / 3600))
    if abs(offset_s) > 1800 and off_hours_s <= _slack_s(before, row):
        text += ": whole hours (daylight saving?)"
    start, end = sorted((time_of(before.end_us), time_of(row.start_us)))
    return StreamEvent(stream, "clock step", start, end, text)


def _note_late(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    not_early = (row for row in rows if row.excluded != EARLY)
    late = [row for row in not_early if time_of(row.arrived_us) > time_of(row.end_us) + _due(row)]
    if late:
        delay_h = max(row.arrived_us - row.end_us for row in late) / 3.6e9
        many = "1 chunk" if len(late) == 1 else f"{len(late)} chunks"
        text = f"{many} came up to {delay_h:.1f} hours late, now in place"
        yield _event(stream, "late", late, text)


def _due(row: Row) -> timedelta:
    return _FILE_LATE if row.sequence >= BY_TIME else PERIOD + GRACE


def _note_overlap(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    overlapping = [row for row in rows if row.covered]
    if overlapping:
        first, last = overlapping[0].sequence, overlapping[-1].sequence
        whose = numbered(first)
        if len(overlapping) > 1:
            named = f", {first} to {last}," if last < BY_TIME else " of files"
            whose = f"{len(overlapping)} chunks{named}"
        text = (
            f"{sum(row.covered for row in overlapping)} samples of {whose} are of a time that was "
            "there already: the first to come count, these are kept apart; see to the logger's "
            "clock"
        )
        yield _event(stream, "overlap", overlapping, text)


def _note_early(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    early = [row for row in rows if row.excluded == EARLY]
    if early:
        yield _event(stream, "clock step", early, EARLY)


def _note_missing(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    """Yield an event for each channel of which the logger says that it lacks some values.

    Of a channel without any the watch over the sensors says that it is dead.
    """
    accepted = [row for row in rows if not row.excluded]
    counts = [[int(each) for each in row.missing.split()] for row in accepted if row.missing]
    samples = sum(row.samples for row in accepted)
    for number, missing in enumerate(map(sum, zip(*counts, strict=True))):
        if 0 < missing < samples:
            text = f"{missing} samples have no value (null or NaN)"
            channel = accepted[0].channels.split()[number]
            yield replace(_event(stream, "gap", accepted, text), channel=channel)


def _note_loggers(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    for row in (row for row in rows if row.event):
        start = time_of(row.start_us)
        yield StreamEvent(stream, "logger", start, start, row.event)


def _is_next(before: Row, row: Row) -> bool:
    return row.sequence == before.sequence + 1 and row.sequence < BY_TIME


def _offset_s(before: Row, row: Row) -> float:
    return (row.start_us - before.end_us) / 1e6


def _slack_s(before: Row, row: Row) -> float:
    numbers = before.sequence, row.sequence
    return slack_s(*numbers, row.sampling_rate_hz, (before.end_us - before.start_us) / 1e6)


def _event(stream: str, kind: StreamEventKind, rows: Sequence[Row], text: str) -> StreamEvent:
    start, end = min(row.start_us for row in rows), max(row.end_us for row in rows)
    return StreamEvent(stream, kind, time_of(start), time_of(end), text)
