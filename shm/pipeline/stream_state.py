"""How each stream is: live or silent, what it has lost, what its last window and hour said."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Literal

from shm.documents import parse_time
from shm.store import Store, Workspace
from shm.store.ring import Ring
from shm.store.ring_files import PERIOD
from shm.values import NAN
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import PooledReading, Stream, StreamEvent, WindowReading
from shm.watch.ambient_hammer import TOGETHER, AmbientBias, ambient_bias

State = Literal["live", "late", "silent", "never sent", "sensor at fault", "clock ahead"]

_LATE, _SILENT = timedelta(minutes=5), timedelta(hours=1)
"""judgement: loggers send each minute; a router begins anew within five minutes."""
_AHEAD = timedelta(minutes=2)  # judgement: clocks without GPS or NTP are seconds off
_LATELY = timedelta(days=1)
_AT_FAULT = ("dead", "drifting", "swapped", "saturated", "thermometer")
_TESTS_COMPARED = 12
"""Judgement: of so many the mean is known to a tenth of what is taken for likely before any."""
_ROWS_SEEN = 1000  # technical: three years of a stream's own days among them
_FAULT_STANDS = timedelta(hours=1)  # six windows: one that shows nothing ends it
_THERMOMETER_STANDS = timedelta(hours=2)  # derived: an hour is judged once it is over


@dataclass(frozen=True, eq=False)
class StreamCondition:
    """`lost_share` is of the samples of the last 24 hours up to the last one, NaN without any.

    `apart_s` is how many seconds of samples came for a time that was there already, in 24 hours:
    they do not count, and are kept beside those that came first.
    `behind` is how much has come and is not read yet; `events` are those of the last 24 hours.
    """

    stream: Stream
    state: State
    last_sample: datetime | None
    lag: timedelta | None
    behind: timedelta | None
    received_hz: float
    lost_share: float
    apart_s: float
    ring_bytes: int
    window: WindowReading | None
    hour: PooledReading | None
    events: tuple[StreamEvent, ...]


def stream_states(
    workspace: Workspace, ring: Ring, store: Store, now: datetime
) -> tuple[StreamCondition, ...]:
    """One for each stream that `bridge.toml` describes, in its order."""
    latest = ring.latest()
    return tuple(
        _state(stream, latest.get(stream.name), ring, store, now)
        for stream in workspace.bridge.streams
    )


def _state(
    stream: Stream, last: datetime | None, ring: Ring, store: Store, now: datetime
) -> StreamCondition:
    events = store.streams.list_events(stream.name, now - _LATELY)
    progress = store.streams.progress(stream.name)
    window = store.streams.last_window(stream.name)
    state = ring.state(stream.name)
    received, lost = _received(state.received_s, last, now)
    return StreamCondition(
        stream=stream,
        state=_word(last, events, now),
        last_sample=last,
        lag=None if last is None else max(timedelta(0), now - last),
        behind=None if last is None or progress is None else max(timedelta(0), last - progress),
        received_hz=received * stream.sampling_rate_hz,
        lost_share=lost,
        apart_s=_lately_s(state.apart_s, now),
        ring_bytes=ring.size_bytes(stream.name),
        window=window,
        hour=store.streams.last_hour(stream.name),
        events=joined(events),
    )


def joined(events: Sequence[StreamEvent]) -> tuple[StreamEvent, ...]:
    """Events of one kind and channel that follow each other, as one that tells the last of them."""
    found: dict[tuple[str, str], list[list[StreamEvent]]] = {}
    for event in events:
        runs = found.setdefault((event.kind, event.channel), [])
        if runs and event.start - runs[-1][-1].end <= PERIOD:
            runs[-1].append(event)
        else:
            runs.append([event])
    whole = (_as_one(run) for runs in found.values() for run in runs)
    return tuple(sorted(whole, key=lambda event: event.start))


def _as_one(run: Sequence[StreamEvent]) -> StreamEvent:
    times = "" if len(run) == 1 else f" ({len(run)} times in a row)"
    return replace(run[-1], start=run[0].start, detail=run[-1].detail + times)


def _received(
    received_s: Mapping[str, float], last_sample: datetime | None, now: datetime
) -> tuple[float, float]:
    """Which share of the last ten minutes that are sealed came, and which share of a day did not,
    up to the last sample.

    The first ten minutes of all may have begun before the stream, and do not count.
    """
    known = {parse_time(start): seconds for start, seconds in received_s.items()}
    first, last = min(known, default=now), max(known, default=now)
    begin = max(first + PERIOD, now - _LATELY)
    if last < begin:
        return NAN, NAN
    end = last + PERIOD if last_sample is None else min(last + PERIOD, last_sample)
    expected_s = max((end - begin).total_seconds(), 1.0)
    came_s = sum(seconds for start, seconds in known.items() if start >= begin)
    of_last_s = max((end - last).total_seconds(), 1.0)
    return min(known[last] / of_last_s, 1.0), min(max(1 - came_s / expected_s, 0.0), 1.0)


def _lately_s(seconds: Mapping[str, float], now: datetime) -> float:
    since = now - _LATELY
    return sum(each for start, each in seconds.items() if parse_time(start) >= since)


def _word(last: datetime | None, events: tuple[StreamEvent, ...], now: datetime) -> State:
    if last is None:
        return "never sent"
    if last - now > _AHEAD:  # whether it still sends cannot be told by its stamps
        return "clock ahead"
    if now - last > _SILENT:
        return "silent"
    if now - last > _LATE:
        return "late"
    faults = (each for each in events if each.kind in _AT_FAULT)
    stands = {"thermometer": _THERMOMETER_STANDS}
    is_faulty = any(last - each.end < stands.get(each.kind, _FAULT_STANDS) for each in faults)
    return "sensor at fault" if is_faulty else "live"


def against_hammer(store: Store, stream: Stream) -> AmbientBias:
    """What a stream's frequencies differ by from those of the latest hammer tests made while it
    ran.
    """
    last = store.streams.last_pooled(stream.name, "hour")
    if last is None:
        return ambient_bias(stream.hanger, (), ())
    own = [
        row.id
        for row in store.tests.list_rows(stream.hanger, _ROWS_SEEN)
        if row.time <= last + TOGETHER
        and not row.name.startswith(f"{stream.name}-{row.time:%Y-%m-%d}")  # a day of its own
    ][:_TESTS_COMPARED]
    tests = [each.test for each in store.tests.list_numbered(own)]
    times = [test.time for test in tests if test.time is not None]
    return ambient_bias(
        stream.hanger, tests, store.streams.list_hours_near(stream.name, times, TOGETHER)
    )


def tension_words(hour: PooledReading | None) -> str:
    """The change of tension with the weather taken off, rounded to its 90 % interval."""
    if hour is None:
        return "no reading yet"
    if hour.learning or not math.isfinite(hour.compensated_shift):
        return hour.learning or "not known"
    reach = 100 * NINETY_PERCENT * hour.compensated_sd
    digits = min(3, max(0, 1 - math.floor(math.log10(reach)))) if reach > 0 else 3
    return f"{100 * hour.compensated_shift:+.{digits}f} ± {reach:.{digits}f} %"
