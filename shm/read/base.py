"""What a format is, and what a look at a file's headers gives.

A file as a table of columns, before it is known which of them is what.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from shm.read.logger_words import Sensitivity
from shm.values import NAN, AddedMass, FloatArray, FrequencyResponse, Plane, Quantity, Recording


@dataclass(frozen=True, eq=False)
class LoggerColumn:
    """A column as recorded: `values` (samples,) in `unit` ("" where the file says none), NaN where
    bad, of which `overloads` were beyond what the logger can record.
    """

    name: str
    unit: str
    values: FloatArray
    overloads: int = 0
    sensitivity: Sensitivity | None = None


@dataclass(frozen=True, eq=False)
class LoggerTable:
    """What a file says: columns but those of times and counters, and facts of the whole.

    `said_rate_hz` is what its heading says, `times_rate_hz` what a column of times tells, NaN
    without. `layout` are the words by which files of one logger are known. `is_text` is False of a
    format that has a reader of its own; `title` is that of a text with one signal.
    """

    columns: tuple[LoggerColumn, ...]
    said_rate_hz: float
    times_rate_hz: float
    hanger: int | None
    time: datetime | None
    temperature_c: float
    names_line: int
    layout: tuple[str, ...]
    remarks: tuple[str, ...]
    is_text: bool = True
    title: str = ""

    @property
    def samples(self) -> int:
        return len(self.columns[0].values) if self.columns else 0


@dataclass(frozen=True)
class PeekChannel:
    """One channel as its headers describe it; `quantity` is None where they do not say.

    `calibration` is in `unit` per recorded unit (volts, counts), `full_scale` in `unit`.
    """

    name: str
    quantity: Quantity | None
    unit: str = ""
    plane: Plane | None = None
    x_m: float = NAN
    calibration: float = NAN
    full_scale: float = NAN


@dataclass(frozen=True)
class Peek:
    """The headers of a file; `problems` are what a reader would refuse.

    A time record has `samples` and a rate, a frequency response `lines` and their step.
    `left_out` names what the file holds besides.
    """

    source: str
    format: str
    channels: tuple[PeekChannel, ...]
    samples: int
    sampling_rate_hz: float = NAN
    hanger: int | None = None
    time: datetime | None = None
    temperature_c: float = NAN
    added_mass: AddedMass | None = None
    problems: tuple[str, ...] = ()
    lines: int = 0
    frequency_step_hz: float = NAN
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Format:
    """One file format: the suffixes it goes by and its verbs.

    `recognises` judges the first bytes of a file; `write` is None of a format that is only read;
    `may_be_gzipped` says whether NAME.csv.gz is read too; `holds_responses` is False of one that
    holds time records alone, `names_channels` of one whose channels have numbers, or names of its
    own. `table` gives all columns of a file, None where it holds no time records. `library` is what
    it loads where a file is read.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    peek: Callable[[Path], Peek]
    read: Callable[[Path], Recording | FrequencyResponse]
    write: Callable[[Recording | FrequencyResponse, Path], None] | None = None
    may_be_gzipped: bool = False
    holds_responses: bool = True
    names_channels: bool = True
    table: Callable[[Path], LoggerTable | None] | None = None
    library: str = ""


def names_in(described: Recording | FrequencyResponse) -> list[str]:
    """The names of the channels, or of the points of frequency responses."""
    if isinstance(described, FrequencyResponse):
        return [point.name for point in described.points]
    return [channel.name for channel in described.channels]
