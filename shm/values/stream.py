"""Permanent sensors: what arrives from them piece by piece, and what is read from it.

A stream is what one logger sends of one hanger. Its chunks become windows, windows become pooled
readings of an hour or a day; a day's reading is a modal test like any other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shm.values.kinds import NAN, FloatArray, Plane
from shm.values.modes import Mode

StreamEventKind: TypeAlias = Literal[
    "gap", "overlap", "late", "doubled", "clock step", "clock drift", "refused",
    "dead", "drifting", "swapped", "saturated", "lost modes", "logger", "thermometer",
]  # fmt: skip
WindowKind: TypeAlias = Literal["wind", "traffic", "knock", "quiet", "unusable"]
Period: TypeAlias = Literal["hour", "six hours", "day"]
PERIODS: Mapping[Period, timedelta] = {  # as their names say
    "hour": timedelta(hours=1),
    "six hours": timedelta(hours=6),
    "day": timedelta(days=1),
}

PERIOD = timedelta(minutes=10)
"""What is sealed as one, and read and identified as one window."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def microseconds(time: datetime) -> int:
    """Return the microseconds since 1970."""
    return (time - _EPOCH) // timedelta(microseconds=1)


def time_of(microseconds: int) -> datetime:
    """Return the time so many microseconds after 1970."""
    return _EPOCH + timedelta(microseconds=microseconds)


def period_start(at: datetime, length: timedelta) -> datetime:
    """Return the beginning of the stretch, of that length from midnight on, that holds a moment."""
    midnight = at.astimezone(UTC).replace(hour=0, minute=0, second=0, microsecond=0)
    return midnight + (at - midnight) // length * length


@dataclass(frozen=True)
class StreamChannel:
    """A sensor that stays: an acceleration in m/s^2 at `x_m`, in one plane."""

    name: str
    plane: Plane
    x_m: float
    full_scale: float = NAN


@dataclass(frozen=True)
class SeedLinkFeed:
    """A SeedLink server that is asked for a stream's samples.

    `ids` are network, station, location (which may be empty) and code of each channel of the
    stream, in its order; `calibrations` what a count of each is worth in m/s^2.
    """

    host: str
    port: int
    ids: tuple[tuple[str, str, str, str], ...]
    calibrations: tuple[float, ...]


@dataclass(frozen=True)
class Stream:
    """A logger that sends for good, as `bridge.toml` describes it; `feed` where it is asked."""

    name: str
    hanger: int
    sampling_rate_hz: float
    channels: tuple[StreamChannel, ...]
    feed: SeedLinkFeed | None = None


@dataclass(frozen=True, eq=False)
class Chunk:
    """Consecutive samples of all channels of a stream: `values` (channels, samples) in m/s^2.

    `sequence` counts the chunks of a stream from any beginning, one by one; `start` is the logger's
    clock at the first sample; `event` what was done to it or its sensors just before.
    """

    stream: str
    sequence: int
    start: datetime
    sampling_rate_hz: float
    channels: tuple[str, ...]
    values: NDArray[np.float32]
    temperature_c: float = NAN
    wind_m_s: float = NAN
    event: str = ""

    @property
    def end(self) -> datetime:
        return self.start + timedelta(seconds=self.values.shape[1] / self.sampling_rate_hz)


@dataclass(frozen=True, eq=False)
class Piece:
    """Samples of a stream without a gap, however many chunks: `values` (channels, samples)."""

    stream: str
    start: datetime
    sampling_rate_hz: float
    channels: tuple[str, ...]
    values: FloatArray
    temperature_c: float = NAN
    wind_m_s: float = NAN


@dataclass(frozen=True)
class StreamEvent:
    """An event of a stream, its clock or a sensor, and how it was handled."""

    stream: str
    kind: StreamEventKind
    start: datetime
    end: datetime
    detail: str
    channel: str = ""


@dataclass(frozen=True)
class Window:
    """A stretch of a stream that is judged and identified as one.

    `level_m_s2` is the rms acceleration in the band of the modes; `unrest` the loudest stretch over
    the median one; `signal_to_noise_db` the height of the modes' peaks over the floor.
    """

    stream: str
    hanger: int
    start: datetime
    duration_s: float
    kind: WindowKind
    level_m_s2: float
    unrest: float = NAN
    signal_to_noise_db: float = NAN
    temperature_c: float = NAN
    wind_m_s: float = NAN


@dataclass(frozen=True)
class WindowReading:
    """The modes of a window, by the last known ones (`tracked`) or `from scratch`, or none.

    `spectrum_db`: the mean power of the channels, in dB over 1 (m/s^2)^2/Hz, on lines evenly spaced
    from 0 to half the sampling rate, each the largest of its stretch; for people to look at.
    """

    window: Window
    modes: tuple[Mode, ...]
    how: Literal["tracked", "from scratch", "none"]
    why: str = ""
    spectrum_db: tuple[int, ...] = ()


@dataclass(frozen=True)
class PooledReading:
    """The windows of an hour or a day as one: modes with errors that allow for what repeats.

    `windows` is how many were pooled, `left_out` how many were not; `level_m_s2`, `temperature_c`
    and `wind_m_s` are means over the pooled ones. The shifts of tension since the stream's
    beginning, as fractions with their standard deviations, are the watch's: as it is, and under the
    conditions of the beginning; `learning` says why there is none yet.
    """

    stream: str
    hanger: int
    start: datetime
    period: Period
    modes: tuple[Mode, ...]
    windows: int
    left_out: int
    level_m_s2: float
    temperature_c: float = NAN
    wind_m_s: float = NAN
    tension_shift: float = NAN
    tension_shift_sd: float = NAN
    compensated_shift: float = NAN
    compensated_sd: float = NAN
    learning: str = ""
