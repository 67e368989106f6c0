"""State of each stream, and its readings over the last days."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np

from shm.pipeline.stream_health import LATELY, StreamHealth, heard
from shm.report.figures.stream_course import StreamHistory
from shm.store import Store, Workspace
from shm.store.ring import ReceivedSamples, Ring
from shm.store.streams import (
    find_last_window,
    find_pooled_range,
    list_hours_near,
    list_pooled,
    list_spectra,
    list_stream_events,
)
from shm.store.tests import list_test_rows
from shm.values import NAN, FloatArray
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import (
    PERIOD,
    PERIODS,
    Period,
    PooledReading,
    Stream,
    StreamEvent,
    WindowReading,
    period_start,
)
from shm.watch.ambient_hammer import TOGETHER, AmbientBias, ambient_bias
from shm.watch.engine.state import Band

_TESTS_COMPARED = 12
"""Judgement: of so many the mean is known to a tenth of what is taken for likely before any."""
_ROWS_SEEN = 1000  # technical: three years of a stream's own days among them


@dataclass(frozen=True, eq=False, kw_only=True)
class StreamCondition(StreamHealth):
    """`lost_share` is of the samples of the last 24 hours up to the last one, NaN without any.

    `apart_s` is how many seconds of samples came for a time that was there already, in 24 hours:
    they do not count, and are kept beside those that came first.
    """

    lag: timedelta | None
    received_hz: float
    lost_share: float
    apart_s: float
    ring_bytes: int
    window: WindowReading | None
    hour: PooledReading | None

    @property
    def behind(self) -> timedelta | None:
        """Return how much has come and is not read yet."""
        return None if self.last_sample is None else self.unread


def stream_states(
    workspace: Workspace, ring: Ring, store: Store, now: datetime
) -> tuple[StreamCondition, ...]:
    """Return the state of each stream that `bridge.toml` describes, in its order."""
    return tuple(_state(each, ring, store, now) for each in heard(workspace, store, now))


def _state(health: StreamHealth, ring: Ring, store: Store, now: datetime) -> StreamCondition:
    stream, last = health.stream, health.last_sample
    samples = ring.received(stream.name, now - LATELY - PERIOD)
    received, lost = _received(samples, now)
    return StreamCondition(
        **{**vars(health), "events": joined(health.events)},
        lag=None if last is None else max(timedelta(0), now - last),
        received_hz=received * stream.sampling_rate_hz,
        lost_share=lost,
        apart_s=sum(each.apart_s for start, each in samples.items() if start >= now - LATELY),
        ring_bytes=ring.size_bytes(stream.name),
        window=find_last_window(store, stream.name),
        hour=_last_hour(store, stream),
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


def _received(samples: Mapping[datetime, ReceivedSamples], now: datetime) -> tuple[float, float]:
    """Return the received fraction of the last ten minutes, and the lost fraction of a day.

    Of samples from the first one on up to the last one. Ten minutes are those of the chunks that
    begin in them: what these have beyond the edges counts.
    """
    spans = {at: (each.start, each.end) for at, each in samples.items() if each.start and each.end}
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
    lost = 1 - sum(samples[start].received_s for start in lately) / expected_s
    return min(samples[last].received_s / of_last_s, 1.0), min(max(lost, 0.0), 1.0)


def _last_hour(store: Store, stream: Stream) -> PooledReading | None:
    hours = find_pooled_range(store, stream.name, "hour")
    if hours is None:
        return None
    found = list_pooled(store, stream.hanger, "hour", hours[1], hours[1] + PERIODS["hour"])
    return next((each for each in found if each.stream == stream.name), None)


def against_hammer(store: Store, stream: Stream) -> AmbientBias:
    """Compare a stream's frequencies with those of hammer tests made while it ran."""
    hours = find_pooled_range(store, stream.name, "hour")
    if hours is None:
        return ambient_bias(stream.hanger, (), ())
    last = hours[1]
    ids = [
        row.id
        for row in list_test_rows(store, stream.hanger, _ROWS_SEEN)
        if row.time <= last + TOGETHER
        and not row.name.startswith(f"{stream.name}-{row.time:%Y-%m-%d}")  # a day of its own
    ][:_TESTS_COMPARED]
    tests = [each.test for each in store.tests.list_all(ids=ids)]
    times = [test.time for test in tests if test.time is not None]
    return ambient_bias(stream.hanger, tests, list_hours_near(store, stream.name, times, TOGETHER))


def tension_words(hour: PooledReading | None) -> str:
    """The change of tension with the weather taken off, rounded to its 90 % interval."""
    if hour is None:
        return "no reading yet"
    if hour.learning or not math.isfinite(hour.compensated_shift):
        return hour.learning or "not known"
    reach = 100 * NINETY_PERCENT * hour.compensated_sd
    digits = min(3, max(0, 1 - math.floor(math.log10(reach)))) if reach > 0 else 3
    return f"{100 * hour.compensated_shift:+.{digits}f} ± {reach:.{digits}f} %"


_LONGEST_SPECTRA = timedelta(days=7)  # technical: a thousand windows of 200 lines


_MOST_SPECTRA = 600  # technical: a spectrogram of more columns than a screen shows
_MOST_READINGS = 800
"""Technical: about as many as a screen shows: hours of a month, six hours of half a year, days."""


def stream_course(
    store: Store, stream: Stream, since: datetime, until: datetime
) -> StreamHistory | None:
    """Hours from `since` to `until`, or what more of them are pooled to where they are too many,
    and the spectra of the last week; None without any.
    """
    period: Period = next(
        (each for each, long in PERIODS.items() if (until - since) / long <= _MOST_READINGS), "day"
    )
    hours = [
        each
        for each in list_pooled(store, stream.hanger, period, since, until)
        if each.stream == stream.name
    ]
    first = max(since, until - _LONGEST_SPECTRA)
    windows = list_spectra(store, stream.name, first, until, _MOST_SPECTRA)
    if not hours and not windows:
        return None
    lines = len(windows[0][1]) if windows else 0
    same_grid = [(at, spectrum) for at, spectrum in windows if len(spectrum) == lines]
    return StreamHistory(
        stream=stream.name,
        window_times=[at for at, _ in same_grid],
        line_hz=(np.arange(lines) + 0.5) * stream.sampling_rate_hz / 2 / max(1, lines),
        spectrum_db=np.array([spectrum for _, spectrum in same_grid], dtype=float),
        hours=[each.start + PERIODS[period] / 2 for each in hours],
        period=period,
        modes=_modes(hours),
        tension=_tension(hours),
        events=list_stream_events(store, stream.name, since),
    )


def _modes(hours: Sequence[PooledReading]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Frequencies and their standard deviations (hours,) by mode, NaN where it was not followed."""
    found: dict[str, tuple[FloatArray, FloatArray]] = {}
    for number, hour in enumerate(hours):
        for mode in hour.modes:
            name = f"{mode.plane} {mode.order}"
            if name not in found:
                found[name] = (np.full(len(hours), np.nan), np.full(len(hours), np.nan))
            found[name][0][number], found[name][1][number] = mode.frequency_hz, mode.frequency_sd_hz
    return found


def _tension(hours: Sequence[PooledReading]) -> Band:
    """The change under the conditions of the beginning, in per cent, with its 90 % interval."""
    shift = 100 * np.array([each.compensated_shift for each in hours], dtype=float)
    reach = 100 * NINETY_PERCENT * np.array([each.compensated_sd for each in hours], dtype=float)
    return Band(shift - reach, shift, shift + reach)
