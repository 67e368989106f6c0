"""What a format is, and what a look into a file gives: its headers, and every column of it before
anybody has said what it does not say.

Files of one logger have one layout: the words of its heading and of its columns, not what they hold
this time. By its fingerprint a logger's profile is found (`shm.read.profiles`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from shm.read.logger_words import Sensitivity
from shm.read.stamps import DayOrder, PossibleTime
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
    """The content of a logger's file: its measured columns, and facts about all of it.

    `said_rate_hz` is what its heading says, `times_rate_hz` what a column of times tells, NaN
    without. `layout` are the words by which files of one logger are known. `is_text` is False of a
    format that has a reader of its own; `title` is that of a text with one signal. `day_order` is
    what its days prove of their order; `possible_times` are several where nothing does
    and `time` can be read in several.
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
    possible_times: tuple[PossibleTime, ...] = ()
    day_order: DayOrder | None = None

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
    `left_out` names what the file holds besides. `possible_times` are several where `time` is None
    because its day can be read in several orders.
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
    possible_times: tuple[datetime, ...] = ()


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


@dataclass(frozen=True, eq=False)
class SurveyedColumn:
    """A column of a file, and what is known of it.

    `values` (samples,) are as recorded, in `unit` ("" where the file says none), None where the
    file is none of time records; `overloads` of them were beyond the range. `quantity` is what it
    counts as, None where it is left out, `meant` what its name alone suggests. `calibration` is in
    `unit` per recorded unit.
    """

    name: str
    unit: str
    values: FloatArray | None
    overloads: int = 0
    quantity: Quantity | None = None
    meant: Quantity | None = None
    plane: Plane | None = None
    x_m: float = NAN
    calibration: float = NAN
    full_scale: float = NAN
    described_unit: str = ""


@dataclass(frozen=True, eq=False)
class Survey:
    """A file as found: NaN and None where it does not say.

    `problems` are what would be refused as it is; `lines` counts those of frequency responses.
    """

    source: str
    format: str
    columns: tuple[SurveyedColumn, ...]
    samples: int
    sampling_rate_hz: float
    hanger: int | None
    time: datetime | None
    temperature_c: float
    layout: Layout
    lines: int = 0
    remarks: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Layout:
    """The layout by which files of one logger are recognised, and facts of this one.

    `hanger` and `says_rate` are what a profile must not say in its stead. `day_order` and
    `possible_times` are those of its table.
    """

    fingerprint: str
    format: str
    columns: tuple[str, ...]
    hanger: int | None = None
    says_rate: bool = False
    day_order: DayOrder | None = None
    possible_times: tuple[PossibleTime, ...] = ()
