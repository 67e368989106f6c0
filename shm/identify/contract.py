"""The contract between what was measured and who identifies modes in it.

An identifier is one function of a `Measurement` that returns a `Finding`. It knows nothing of
hits, files, planes or orders; a new one is one file and one line in `IDENTIFIERS`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shm.values import (
    NAN,
    Channel,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Mode,
    Plane,
    ResponsePoint,
)

LEAST_HITS = 3
"""Student's 95 % quantile is 1.8 times the normal one with two degrees of freedom, 3.8 with one."""
FREQUENCY_FLOOR = 0.001
"""With fewer than three hits nothing says how well hits repeat. The frequency then gets this
standard deviation, as a fraction: what hangers' frequencies differ by from one day to the next.
Damping and shape stay without."""

Place: TypeAlias = tuple[Plane | None, float | None, str]
"""Plane, position in m where stated, else the name: equal for one point in several set-ups."""


def point_of(channel: Channel) -> ResponsePoint:
    """Return the point where a channel's sensor is mounted, or its hammer hits."""
    return ResponsePoint(channel.name, channel.plane, channel.x_m)


def place_of(point: ResponsePoint) -> Place:
    """Return what identifies a point in several set-ups."""
    if math.isnan(point.x_m):
        return point.plane, None, point.name
    return point.plane, point.x_m, ""


@dataclass(frozen=True)
class Dropped:
    """Something that was left out: what, how many of them, and why; of a mode its frequency."""

    what: str
    count: int
    reason: str
    frequency_hz: float = NAN


@dataclass(frozen=True)
class Hit:
    """One hammer hit: where it begins in which record, how hard it was, whether it was used.

    `peak_force_n` is NaN where no force was recorded. `reason` is why it was not used; `cut`: why a
    used one's ring-down is taken from later on than its end.
    """

    record: int
    start: int
    start_s: float
    peak_force_n: float
    used: bool = True
    reason: str = ""
    cut: str = ""


@dataclass(frozen=True)
class Tone:
    """A steady vibration that is there whether the hammer hits or not; `name`: where it is from."""

    frequency_hz: float
    name: str


@dataclass(frozen=True, eq=False)
class Poles:
    """The poles in the band over all model orders, for a stabilisation diagram; arrays (poles,)."""

    order: FloatArray
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    stable: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Measurement:
    """One set-up of a test, sensors and hammer at their places, as an identifier sees it.

    `decays` holds the ring-down after each used hit, each (points, samples), low-passed to the
    band and sampled at `sampling_rate_hz`; a hit's forced part is not in it. `driven` holds the
    same hits from just before the hammer strikes, each (1 + points, samples), the force first; it
    is empty where only frequency responses are known, or no force. `spectra` holds those of each
    used hit, windowed, on the lines of `frequency_response`: (hits, 1 + points, lines), the force
    first. `hammer` is where and in which direction it hit. Hits of unknown force have `decays` and
    `hits` alone. Ambient records have none of these: their `decays` are parts of the record.
    Exponential windows of `window_time_constant_s` and `decay_time_constant_s` (inf: none) lie on
    spectra and frequency responses, and on `decays`. `unlike` is how far the responses of its hits
    are from each other (0 alike, 1 unlike), NaN below three hits.
    """

    source: str
    points: tuple[ResponsePoint, ...]
    decays: tuple[FloatArray, ...]
    sampling_rate_hz: float
    frequency_response: FrequencyResponse | None
    driven: tuple[FloatArray, ...] = ()
    spectra: ComplexArray | None = None
    hammer: ResponsePoint | None = None
    window_time_constant_s: float = math.inf
    decay_time_constant_s: float = math.inf
    hits: tuple[Hit, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    unlike: float = NAN


@dataclass(frozen=True, eq=False)
class FoundMode:
    """A mode before it has a plane and an order.

    `shape` and `shape_sd` (points,): real, largest absolute value 1. Standard deviations are NaN
    where there are too few hits to know them. `acceleration_m_s2`: see `Mode`; an identifier
    leaves it out, as it does `amplitude_slope`: see `Mode`.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: FloatArray
    shape_sd: FloatArray
    acceleration_m_s2: float = NAN
    amplitude_slope: float = NAN
    amplitude_slope_sd: float = NAN


@dataclass(frozen=True, eq=False)
class Finding:
    """Hold the modes that an identifier found, by rising frequency, and the poles that it dropped.

    `doubtful` are dropped ones that may be modes: one hit or one order disagrees. `late_s` are
    the delays (channels,) that were removed from the shapes; None where none was.
    """

    modes: tuple[FoundMode, ...]
    dropped: tuple[Dropped, ...]
    poles: Poles
    doubtful: tuple[FoundMode, ...] = ()
    late_s: FloatArray | None = None


def poles_of_modes(modes: Sequence[FoundMode] | Sequence[Mode]) -> ComplexArray:
    """Return the poles in rad/s above the real axis, (modes,)."""
    omega = 2 * np.pi * np.array([mode.frequency_hz for mode in modes])
    damping = np.array([mode.damping_ratio for mode in modes])
    return np.asarray(omega * (-damping + 1j * np.sqrt(1 - damping**2)))
