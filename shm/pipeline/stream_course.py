"""What a stream has shown over the last days, gathered for its figure."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from shm.report.figures.stream_course import Course
from shm.store import Store
from shm.values import FloatArray
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import PooledReading, Stream
from shm.watch.history import Band

_LONGEST_SPECTRA = timedelta(days=7)  # technical: a thousand windows of 200 lines


def stream_course(store: Store, stream: Stream, since: datetime, until: datetime) -> Course | None:
    """Hours from `since` to `until`, and the spectra of the last week of them; None without any."""
    hours = [
        each
        for each in store.streams.list_pooled(stream.hanger, "hour", since, until)
        if each.stream == stream.name
    ]
    first = max(since, until - _LONGEST_SPECTRA)
    windows = [
        each
        for each in store.streams.list_windows(stream.hanger, first, until)
        if each.window.stream == stream.name and each.spectrum_db
    ]
    if not hours and not windows:
        return None
    lines = len(windows[0].spectrum_db) if windows else 0
    alike = [each for each in windows if len(each.spectrum_db) == lines]
    return Course(
        stream=stream.name,
        window_times=[each.window.start for each in alike],
        line_hz=(np.arange(lines) + 0.5) * stream.sampling_rate_hz / 2 / max(1, lines),
        spectrum_db=np.array([each.spectrum_db for each in alike], dtype=float),
        hours=[each.start + timedelta(minutes=30) for each in hours],
        modes=_modes(hours),
        tension=_tension(hours),
        events=store.streams.list_events(stream.name, since),
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
