"""What a format is, and what a look at a file's headers gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from shm.values import NAN, FrequencyResponse, Plane, Quantity, Recording


@dataclass(frozen=True)
class PeekChannel:
    """One channel as its headers describe it; `quantity` is None where they do not say."""

    name: str
    quantity: Quantity | None
    unit: str = ""
    plane: Plane | None = None
    x_m: float = NAN


@dataclass(frozen=True)
class Peek:
    """The headers of a file; `problems` are what a reader would refuse or leave out."""

    source: str
    format: str
    channels: tuple[PeekChannel, ...]
    samples: int
    sampling_rate_hz: float = NAN
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Format:
    """One file format: the suffixes it goes by and its verbs.

    `recognises` judges the first bytes of a file. `holds_gaps` says whether NaN survives,
    `holds_frequency_responses` whether a FrequencyResponse can be written, `needs_sidecar`
    whether `write` adds NAME.toml.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    peek: Callable[[Path], Peek]
    read: Callable[[Path], Recording | FrequencyResponse]
    write: Callable[[Recording | FrequencyResponse, Path], None]
    holds_gaps: bool
    holds_frequency_responses: bool
    needs_sidecar: bool
