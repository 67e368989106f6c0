"""Events of a stream noted as its chunks are sealed: gaps, overlaps, clocks, late chunks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import timedelta
from itertools import groupby, pairwise

from shm.read.chunk_document import BY_TIME, numbered
from shm.store.ring_days import Row
from shm.store.ring_fit import slack_s
from shm.values.stream import PERIOD, StreamEvent, StreamEventKind, time_of

GRACE = timedelta(seconds=30)  # judgement: how long what is sent at once may be on its way
_FILE_LATE = timedelta(hours=25)  # judgement: a logger may roll its files once a day
DRIFT_PPM = 100.0  # as the setting frequency_allowance: every frequency is wrong by as much
DRIFT_US = 6 * 3_600_000_000  # derived: a jitter of 50 ms at both ends is then 5 ppm

OVERLAP = "its time was there already"
EARLY = (
    "the clock was ahead: samples came before the time they are dated; those that came in time "
    "count"
)

HOURS_AHEAD = "ahead (daylight saving?)"


def hours_ahead(hours: int) -> str:
    """Return the reason why samples do not count that a clock dated ahead by whole hours."""
    number = "1 hour" if hours == 1 else f"{hours} hours"
    return f"the clock was {number} {HOURS_AHEAD}"


def is_of_clock(row: Row) -> bool:
    """Return True if a chunk does not count because its clock was ahead."""
    return row.excluded.startswith("the clock was ")


def list_clock_events(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    """Yield an event for each reason why a clock ahead lets chunks count no more."""
    for reason, group in groupby(sorted(rows, key=lambda row: row.excluded), _reason):
        own = list(group)
        text = reason
        if reason != EARLY:
            chunks = "1 chunk is" if len(own) == 1 else f"{len(own)} chunks are"
            text = f"{reason}: {chunks} set aside; the samples that came later count"
        yield _event(stream, "clock step", own, text)


def _reason(row: Row) -> str:
    return row.excluded


def list_events(
    stream: str, last: Row | None, rows: Sequence[Row]
) -> tuple[list[StreamEvent], Row | None]:
    """Compare chunks, by time, with those before; return events and the last chunk after them."""
    events: list[StreamEvent] = []
    for row in rows:
        if last is None or row.start_us >= last.start_us:
            events += [] if last is None else _between(stream, last, row)
            last = row
        elif _is_next(last, row):
            events.append(_stepped(stream, last, row))
    channels = rows[0].channels.split() if rows else []
    notes = (_note_late, _note_overlap, _note_misplaced)
    events += [event for note in notes for event in note(stream, rows)]
    events += _note_missing(stream, channels, rows)
    for row in rows:
        if row.event:
            start = time_of(row.start_us)
            events.append(StreamEvent(stream, "logger", start, start, row.event))
    return events, last


def find_drift(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    """Yield an event if the stamps of hours disagree with the count of samples without a gap."""
    if not rows or rows[-1].end_us - rows[0].start_us < 0.9 * DRIFT_US:
        return
    for before, after in pairwise(rows):
        follows = _is_next(before, after) or after.sequence >= BY_TIME
        if not follows or abs(_offset_s(before, after)) > _slack_s(before, after):
            return
    elapsed_s = (rows[-1].start_us - rows[0].start_us) / 1e6
    counted_s = sum(row.samples / row.sampling_rate_hz for row in rows[:-1])
    ppm = (counted_s - elapsed_s) / elapsed_s * 1e6
    if abs(ppm) > DRIFT_PPM:
        what = "more" if ppm > 0 else "fewer"
        text = (
            f"{abs(ppm):.0f} ppm {what} samples came than the stamps say: frequencies are as wrong"
        )
        yield _event(stream, "clock drift", rows, text)


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
    late = [row for row in rows if time_of(row.arrived_us) > time_of(row.end_us) + _due(row)]
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


def _note_misplaced(stream: str, rows: Sequence[Row]) -> Iterator[StreamEvent]:
    own = [row for row in rows if row.misplaced]
    if own:
        whose = " to ".join(dict.fromkeys(str(row.sequence) for row in (own[0], own[-1])))
        text = (
            f"chunk {whose} is stamped between chunks {own[0].misplaced}, where its number does "
            "not belong: the clock stepped into a gap, and these samples are of another time"
        )
        yield _event(stream, "clock step", own, text)


def _note_missing(
    stream: str, channels: Sequence[str], rows: Sequence[Row]
) -> Iterator[StreamEvent]:
    """Yield an event for each channel of which the logger says that it lacks some values.

    Of a channel without any the watch over the sensors says that it is dead.
    """
    counts = [[int(each) for each in row.missing.split()] for row in rows if row.missing]
    samples = sum(row.samples for row in rows)
    for channel, missing in zip(channels, map(sum, zip(*counts, strict=True)), strict=False):
        if 0 < missing < samples:
            text = f"{missing} samples have no value (null or NaN)"
            edges = time_of(rows[0].start_us), time_of(max(row.end_us for row in rows))
            yield StreamEvent(stream, "gap", *edges, text, channel)


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
