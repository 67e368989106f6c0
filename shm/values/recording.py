"""Recordings of loggers and analysers, and reasons to doubt one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shm.values.kinds import NAN, ComplexArray, FloatArray, IntArray, Plane, Quantity
from shm.values.showing import Displayable, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class AddedMass:
    """A known mass clamped on the hanger for one test, which turns with the bar.

    `radius_of_gyration_m` is about the axis across the bar and its plane, 0 of a point; None where
    nobody says it.
    """

    mass_kg: float
    x_m: float
    radius_of_gyration_m: float | None = None

    def with_usual_radius(self, radius_m: float) -> AddedMass:
        """Return the same with this radius of gyration, where none is stated."""
        stated = self.radius_of_gyration_m
        return self if stated is not None else replace(self, radius_of_gyration_m=radius_m)


@dataclass(frozen=True, eq=False)
class Channel:
    """One sensor of a recording; `values` has shape (samples,), in N or m/s^2, NaN where bad.

    `full_scale` is the largest value that sensor and logger can record, NaN where nobody says.
    `states_unit` is false where neither file nor sidecar says a unit, so that SI was assumed.
    """

    name: str
    quantity: Quantity
    values: FloatArray
    plane: Plane | None = None
    x_m: float = NAN
    full_scale: float = NAN
    states_unit: bool = True


@dataclass(frozen=True, eq=False)
class Recording(Displayable):
    """Accelerations over time, as received, with the hammer's force unless nobody hit.

    One file, one or many hits. The force channel's `x_m` and `plane` say where and in which
    direction the hammer hit. `possible_times` are several where `time` is None because its day can
    be read in several orders; empty otherwise. `operator` measured, "" where nobody says.
    """

    source: str
    channels: tuple[Channel, ...]
    sampling_rate_hz: float
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    added_mass: AddedMass | None = None
    possible_times: tuple[datetime, ...] = ()
    operator: str = ""

    @property
    def force(self) -> Channel | None:
        return next((c for c in self.channels if c.quantity == "force"), None)

    @property
    def accelerations(self) -> tuple[Channel, ...]:
        return tuple(c for c in self.channels if c.quantity == "acceleration")

    @property
    def samples(self) -> int:
        return len(self.channels[0].values) if self.channels else 0

    @property
    def duration_s(self) -> float:
        return self.samples / self.sampling_rate_hz

    def to_sep005(self) -> list[dict[str, Any]]:
        """Return the channels as the dictionaries of SDyPy's enhancement proposal 5.

        Units are N and m/s^2. Hanger, places and planes, which it does not know, are left out.
        """
        start = {} if self.time is None else {"start_timestamp": self.time.isoformat()}
        units = {"force": ("N", "f"), "acceleration": ("m/s^2", "a")}
        return [
            {
                "data": channel.values,
                "name": channel.name,
                "unit_str": units[channel.quantity][0],
                "quantity": units[channel.quantity][1],
                "fs": self.sampling_rate_hz,
                **start,
            }
            for channel in self.channels
        ]

    def plot(self, ax: Axes | Sequence[Axes] | None = None) -> Figure:
        """Draw all channels over time: the figure of `shm.plot.recording`.

        Example:
            >>> shm.read("hanger3.csv").plot()
        """
        figure: Figure = front().plot.recording(self, ax=ax)
        return figure


TEST_CONDITIONS = ("hanger", "time", "temperature_c", "added_mass", "operator")
"""What recordings, frequency responses and modal tests alike hold of how a test was made."""


def collect_conditions(test: Any) -> dict[str, Any]:
    """Return the conditions of a test by name, from whatever has them as attributes."""
    return {name: getattr(test, name) for name in TEST_CONDITIONS}


def collect_known_conditions(test: Any) -> dict[str, Any]:
    """Return the conditions that are neither None, nor NaN, nor an empty text."""
    stated = collect_conditions(test)
    return {
        key: value for key, value in stated.items() if value not in (None, "") and value == value
    }


@dataclass(frozen=True)
class ResponsePoint:
    """Return the position of the response or, with a roving hammer, of the hit (reciprocity)."""

    name: str
    plane: Plane | None = None
    x_m: float = NAN


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Accelerance of each response to the hammer force.

    `frequency_hz` (lines,), evenly spaced from 0; `accelerance` (points, lines), complex, in
    m/s^2/N; `coherence` (points, lines) or None where the averages are not known.
    """

    source: str
    points: tuple[ResponsePoint, ...]
    frequency_hz: FloatArray
    accelerance: ComplexArray
    coherence: FloatArray | None = None
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    added_mass: AddedMass | None = None
    operator: str = ""


@dataclass(frozen=True)
class Doubt:
    """One reason to hold a test until a person has looked: three short texts for that person.

    `state` says what is the matter and `action` what to do, both without a full stop; `why` is a
    sentence on how that was found. `check` names the check that raised it. `time_unknown`: the
    test's time is certainly wrong, and one that is confirmed without another counts from its
    receipt. `instead_of` are the numbers of recordings of which it holds more than they do: they
    are to be discarded if it shall count.
    """

    check: str
    state: str
    action: str
    why: str
    time_unknown: bool = False
    instead_of: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """Fingerprint of the samples of a recording, independent of the file around them.

    `digest` is a SHA-256 of the samples of all channels, each to single precision and in whatever
    order. `shapes` (shapes, samples) are stretches of the channels about places that the samples
    near by choose, the same for other units, and in a part of the record. `marks` (shapes, 4) says
    of each its channel, how many samples that has, its place and its reach to either side; prints
    of before there were places have none, and tell by their digest alone.
    """

    digest: str
    shapes: NDArray[np.int16]
    marks: IntArray = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))


@dataclass(frozen=True, eq=False)
class KnownSamples:
    """An earlier recording, how to call it, and what its samples look like.

    `counts` is false of one that is held itself: it may be a copy, too.
    """

    name: str
    hanger: int | None
    fingerprint: Fingerprint
    recording_id: int = 0
    counts: bool = True
