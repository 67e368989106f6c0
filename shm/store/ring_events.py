"""Events of a stream noted as its chunks are sealed: gaps, overlaps, clocks, late chunks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import timedelta

from shm.read.chunk_document import BY_TIME, numbered
from shm.store.ring_days import Row
from shm.store.ring_fit import slack_s
from shm.values.stream import PERIOD, StreamEvent, StreamEventKind, time_of

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
    own = (row for row in rows if row.excluded != EARLY)
    late = [row for row in own if time_of(row.arrived_us) > time_of(row.end_us) + _due(row)]
    if late:
        delay_h = max(row.arrived_us - row.end_us for row in late) / 3.6e9
        many = "1 chunk" if len(late) == 1 else f"{len(late)} chunks"
        text = f"{many} came up to {delay_h:.1f} hours late, now in place"
        yield _event(stream, "late", late, text)


def _due(row: Row) -> timedelta:
    return _FILE_LATE if row.sequence >= BY_TIME else PERIOD + GRACE


def _note_overlap(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    own = [row for row in rows if row.covered]
    if own:
        first, last = own[0].sequence, own[-1].sequence
        whose = numbered(first)
        if len(own) > 1:
            named = f", {first} to {last}," if last < BY_TIME else " of files"
            whose = f"{len(own)} chunks{named}"
        text = (
            f"{sum(row.covered for row in own)} samples of {whose} are of a time that was there "
            "already: the first to come count, these are kept apart; see to the logger's clock"
        )
        yield _event(stream, "overlap", own, text)


def _note_early(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    own = [row for row in rows if row.excluded == EARLY]
    if own:
        yield _event(stream, "clock step", own, EARLY)


def _note_missing(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    """Yield an event for each channel of which the logger says that it lacks some values.

    Of a channel without any the watch over the sensors says that it is dead.
    """
    own = [row for row in rows if not row.excluded]
    counts = [[int(each) for each in row.missing.split()] for row in own if row.missing]
    samples = sum(row.samples for row in own)
    for number, missing in enumerate(map(sum, zip(*counts, strict=True))):
        if 0 < missing < samples:
            text = f"{missing} samples have no value (null or NaN)"
            channel = own[0].channels.split()[number]
            yield replace(_event(stream, "gap", own, text), channel=channel)


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
