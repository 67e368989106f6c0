"""What loggers and analysers deliver."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from shm.values.kinds import NAN, ComplexArray, FloatArray, Plane, Quantity


@dataclass(frozen=True)
class AddedMass:
    """A known mass clamped on the hanger for one test."""

    mass_kg: float
    x_m: float


@dataclass(frozen=True, eq=False)
class Channel:
    """One sensor of a recording; `values` has shape (samples,), in N or m/s^2, NaN where bad.

    `full_scale` is the largest value that sensor and logger can record, NaN where nobody says.
    """

    name: str
    quantity: Quantity
    values: FloatArray
    plane: Plane | None = None
    x_m: float = NAN
    full_scale: float = NAN


@dataclass(frozen=True, eq=False)
class Recording:
    """Accelerations over time, as received, with the hammer's force unless nobody hit.

    One file, one or many hits. The force channel's `x_m` and `plane` say where and in which
    direction the hammer hit.
    """

    source: str
    channels: tuple[Channel, ...]
    sampling_rate_hz: float
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    added_mass: AddedMass | None = None

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


@dataclass(frozen=True)
class ResponsePoint:
    """Where a response was measured, or (roving hammer, by reciprocity) where it was excited."""

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
