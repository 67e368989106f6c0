"""What a stream has shown over the last days, gathered for its figure."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from shm.report.figures.stream_course import Course
from shm.store import Store
from shm.values import FloatArray
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import PERIODS, Period, PooledReading, Stream
from shm.watch.history import Band

_LONGEST_SPECTRA = timedelta(days=7)  # technical: a thousand windows of 200 lines


_MOST_SPECTRA = 600  # technical: a spectrogram of more columns than a screen shows
_MOST_READINGS = 800
"""Technical: about as many as a screen shows: hours of a month, six hours of half a year, days."""


def stream_course(store: Store, stream: Stream, since: datetime, until: datetime) -> Course | None:
    """Hours from `since` to `until`, or what more of them are pooled to where they are too many,
    and the spectra of the last week; None without any.
    """
    period: Period = next(
        (each for each, long in PERIODS.items() if (until - since) / long <= _MOST_READINGS), "day"
    )
    hours = [
        each
        for each in store.streams.list_pooled(stream.hanger, period, since, until)
        if each.stream == stream.name
    ]
    first = max(since, until - _LONGEST_SPECTRA)
    windows = store.streams.list_spectra(stream.name, first, until, _MOST_SPECTRA)
    if not hours and not windows:
        return None
    lines = len(windows[0][1]) if windows else 0
    alike = [(at, spectrum) for at, spectrum in windows if len(spectrum) == lines]
    return Course(
        stream=stream.name,
        window_times=[at for at, _ in alike],
        line_hz=(np.arange(lines) + 0.5) * stream.sampling_rate_hz / 2 / max(1, lines),
        spectrum_db=np.array([spectrum for _, spectrum in alike], dtype=float),
        hours=[each.start + PERIODS[period] / 2 for each in hours],
        period=period,
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
