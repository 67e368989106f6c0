"""How each stream is: live or silent, what it has lost, what its last window and hour said."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from shm.documents import parse_time
from shm.pipeline.unheard import LATELY, State, word_of
from shm.store import Store, Workspace
from shm.store.ring import Ring
from shm.store.ring_files import PERIOD
from shm.store.ring_notices import StreamState as RingState
from shm.values import NAN
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import PooledReading, Stream, StreamEvent, WindowReading, period_start
from shm.watch.ambient_hammer import TOGETHER, AmbientBias, ambient_bias

_TESTS_COMPARED = 12
"""Judgement: of so many the mean is known to a tenth of what is taken for likely before any."""
_ROWS_SEEN = 1000  # technical: three years of a stream's own days among them


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
    events = store.streams.list_events(stream.name, now - LATELY)
    progress = store.streams.progress(stream.name)
    window = store.streams.last_window(stream.name)
    state = ring.state(stream.name)
    received, lost = _received(state, now)
    return StreamCondition(
        stream=stream,
        state=word_of(last, events, now),
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


def _received(state: RingState, now: datetime) -> tuple[float, float]:
    """Which share of the last ten minutes that are sealed came, and which share of a day did not,
    from the first sample on up to the last one.

    Ten minutes are those of the chunks that begin in them: what these have beyond the edges counts.
    """
    came_s = {parse_time(start): seconds for start, seconds in state.received_s.items()}
    spans = {parse_time(start): span for start, span in state.spans.items()}
    since = period_start(now - LATELY, PERIOD) + PERIOD
    lately = sorted(start for start in spans if start >= since)
    if not lately:
        return NAN, NAN
    before = max((end for start, (_, end) in spans.items() if start < lately[0]), default=None)
    begin = spans[lately[0]][0] if before is None else max(before, since)
    end, last = max(spans[start][1] for start in lately), lately[-1]
    until_last = max((spans[start][1] for start in spans if start < last), default=spans[last][0])
    expected_s = max((end - begin).total_seconds(), 1.0)
    of_last_s = max((end - max(last, until_last)).total_seconds(), 1.0)
    lost = 1 - sum(came_s[start] for start in lately) / expected_s
    return min(came_s[last] / of_last_s, 1.0), min(max(lost, 0.0), 1.0)


def _lately_s(seconds: Mapping[str, float], now: datetime) -> float:
    since = now - LATELY
    return sum(each for start, each in seconds.items() if parse_time(start) >= since)


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
