"""Computations of streams: functions of plain values, run wherever the executor puts them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
import scipy

from shm.errors import NothingThere
from shm.identify import IdentifyOptions
from shm.monitor import as_modal_test, pooled, read_window, sensor_faults
from shm.values import PLANES, Alert, Hanger, ModalTest, Mode, Plane, Posterior
from shm.values.stream import Period, Piece, PooledReading, Stream, StreamEvent, WindowReading
from shm.watch.sensors.stream_watch import StreamOptions, watch_reading, with_believed
from shm.watch.words.notices import led_by

_LINES = 200  # technical: of a spectrogram, as many as a panel has pixels
_LINES_S = 20.0  # technical: stretches that part modes 0.1 Hz apart
_FLOOR_DB = -200  # of a channel that is exactly 0


@dataclass(frozen=True, eq=False)
class WindowFound:
    """The modes of a window, and faults of sensors.

    `lacks_modes`: of some plane, half of the known modes or more were not found.
    """

    reading: WindowReading
    events: tuple[StreamEvent, ...]
    lacks_modes: bool = False


def read_stream_window(
    pieces: Sequence[Piece],
    stream: Stream,
    known: Sequence[Mode],
    hanger: Hanger,
    options: IdentifyOptions,
    is_confirmed: bool = True,
) -> WindowFound:
    """Return the modes of ten minutes by the last `known` ones.

    Raises NothingThere where no sample counts, as where the clock was ahead.
    """
    if not pieces:
        raise NothingThere("none of its samples count.")
    passed = options.passed_at(stream.sampling_rate_hz)
    reading = read_window(pieces, stream, known, hanger, passed, is_confirmed)
    return WindowFound(
        replace(reading, spectrum_db=spectrum_db(pieces)),
        sensor_faults(pieces, stream, known),
        any(_lacks_modes(plane, known, reading) for plane in PLANES),
    )


def _lacks_modes(plane: Plane, known: Sequence[Mode], reading: WindowReading) -> bool:
    n_known, n_seen = (sum(m.plane == plane for m in modes) for modes in (known, reading.modes))
    return n_known > 0 and 2 * n_seen <= n_known


def spectrum_db(pieces: Sequence[Piece]) -> tuple[int, ...]:
    """The mean power of the channels, the largest of each of 200 stretches up to half the rate."""
    found = [_power(piece) for piece in pieces if _is_whole(piece)]
    if not found:
        return ()
    power = np.max(found, axis=0)
    edges = np.linspace(0, len(power), _LINES + 1).astype(int)
    largest = np.maximum.reduceat(power, edges[:-1])
    level = 10 * np.log10(np.maximum(largest, 10.0 ** (_FLOOR_DB / 10)))
    return tuple(np.round(level).astype(int).tolist())


def _is_whole(piece: Piece) -> bool:
    return bool(piece.values.shape[1] >= _LINES_S * piece.sampling_rate_hz)


def _power(piece: Piece) -> np.ndarray:
    known = np.nan_to_num(piece.values)
    size = int(_LINES_S * piece.sampling_rate_hz)
    _, density = scipy.signal.welch(known, piece.sampling_rate_hz, nperseg=size, noverlap=0)
    return np.asarray(density.mean(axis=0))


@dataclass(frozen=True, eq=False)
class Pooled:
    """A reading of a period, what the watch keeps, calls for and ends, a day as a modal test."""

    reading: PooledReading | None
    state: bytes | None = None
    alert: Alert | None = None
    events: tuple[StreamEvent, ...] = ()
    test: ModalTest | None = None
    ended: tuple[str, ...] = ()


def pool_stream(
    readings: Sequence[WindowReading],
    period: Period,
    start: datetime,
    hanger: Hanger,
    baseline: Posterior | None,
    state: bytes | None,
    false_call_years: float,
    events: Sequence[StreamEvent] = (),
    *,
    is_watched: bool = True,
) -> Pooled:
    """Pool the windows of a period: an hour goes on to the watch where it `is_watched`, a day
    becomes a test.

    An alert is led by that of `events` which was at the time of its change.
    """
    state, warm = with_believed(state, readings)
    readings, noticed = warm.windows, warm.events if period == "hour" else ()
    reading = pooled(readings, period, start)
    if reading is None:
        return Pooled(None, events=noticed)
    if period == "day":
        return Pooled(reading, test=as_modal_test(reading))
    if period != "hour" or not is_watched or not hanger.is_modelled:
        return Pooled(reading, events=noticed)
    stated_years = hanger.thresholds.false_call_years
    options = StreamOptions(limit_years=false_call_years if stated_years is None else stated_years)
    found = watch_reading(baseline, reading, hanger, state, options)
    watched = replace(
        reading,
        tension_shift=found.tension_shift,
        tension_shift_sd=found.tension_shift_sd,
        compensated_shift=found.compensated_shift,
        compensated_sd=found.compensated_sd,
        learning=found.learning,
    )
    noticed = (*noticed, *found.events)
    alert = found.alert and led_by(found.alert, (*events, *noticed))
    return Pooled(watched, found.kept, alert, noticed, ended=found.ended)
