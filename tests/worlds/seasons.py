"""What worlds of seasons share: events, streams of random numbers, lags, a mode of a test."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.signal import lfilter

from tests.worlds.bars import Array

PLANES = ("transverse", "longitudinal")
ENDS = ("deck", "arch")
REFERENCE_C = 10.0
YEAR_D = 365.25
KINDS = (
    "none",
    "tension_step",  # size: fraction of its tension, e.g. -0.03; neighbours carry the rest
    "tension_ramp",  # size: fraction a year
    "retensioned",  # size: fraction; by the owner, `told` or not; the deck end sits otherwise
    "neighbour_lost",  # size: the fraction that this hanger gains
    "springs",  # size: factor on the springs at `end`, in `planes`
    "lamp",  # size: kg, at `place`
    "section_loss",  # size: lost part of the area, around `place` over `extent`; tension kept
    "sensor_moved",  # size: kg of the new sensor at `place`, or its new place, as the world has it
    "clock",  # size: 0.002 reads all frequencies of all hangers 0.2 % high
)


@dataclass(frozen=True)
class Event:
    """One thing that happens to a hanger on a day, counted from the first of the season."""

    kind: str = "none"
    hanger: int = 0
    day: float = 0.0
    size: float = 0.0
    place: float = 0.4  # share of the length from the deck end
    extent: float = 0.1  # share of the length
    end: str = "deck"  # or arch, both
    planes: tuple[str, ...] = PLANES
    told: bool = False

    def __post_init__(self) -> None:
        ends, others = (*ENDS, "both"), {*self.planes} - {*PLANES}
        if self.kind not in KINDS or self.end not in ends or others:
            raise ValueError(f"no such event: {self}")

    @property
    def at_ends(self) -> list[int]:
        """Return the numbers of the ends that it is about."""
        return [number for number, end in enumerate(ENDS) if self.end in (end, "both")]


class Switched:
    """Nuisances of a world, a dataclass of numbers that are nothing at zero."""

    @classmethod
    def none(cls, **on: Any) -> Self:
        """Return the textbook: all off, but for what is named."""
        off = {
            name: (0.0, 0.0) if isinstance(value, tuple) else type(value)()
            for name, value in vars(cls()).items()
        }
        return cls(**(off | on))


def stream(seed: int, law: str, *keys: int) -> np.random.Generator:
    """Return the random numbers of one law, alike whatever the others are."""
    return np.random.default_rng([seed, zlib.crc32(law.encode()), *keys])


def lagged(drive: Array, lag: float, step: float = 1.0) -> Array:
    """Return the response of first order to a drive, settled at its first value."""
    kept = math.exp(-step / lag)
    return np.asarray(lfilter([1 - kept], [1.0, -kept], drive, zi=[kept * drive[0]])[0])


def mode(plane: str, order: int, hz: float, sd_hz: float, damping: float) -> dict[str, Any]:
    """Return a mode as a test's document has it."""
    return {
        "plane": plane, "order": order, "frequency_hz": float(hz), "frequency_sd_hz": float(sd_hz),
        "damping_ratio": float(damping),
    }  # fmt: skip
