"""Define what a format is, and what a look into a file returns: its headers and all its columns.

Files of one logger have one layout: the words of the heading and of the columns, without their
values. The fingerprint of the layout finds the logger's profile (`shm.read.profiles`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from shm.read.stamps import DayOrder, PossibleTime
from shm.values import NAN, AddedMass, FloatArray, FrequencyResponse, Plane, Quantity, Recording

if TYPE_CHECKING:
    from shm.read.table import Table


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
    operator: str = ""


@dataclass(frozen=True)
class Format:
    """One file format: the suffixes it goes by, how it is told, and how it is opened.

    `recognises` judges the first bytes of a file; `open_tables` gives what a file holds, a table
    for each record, as long as the context lasts. `write` is None of a format that is only read;
    `may_be_gzipped` says whether NAME.csv.gz is read too. `library` is what it loads where a file
    is read; `shared_suffixes` are those of a text that its content may have too.
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    open_tables: Callable[[Path], AbstractContextManager[tuple[Table, ...]]]
    write: Callable[[Recording | FrequencyResponse, Path], None] | None = None
    may_be_gzipped: bool = False
    library: str = ""
    shared_suffixes: tuple[str, ...] = ()


def at_once(
    open_tables: Callable[[Path], tuple[Table, ...]],
) -> Callable[[Path], AbstractContextManager[tuple[Table, ...]]]:
    """Return the way to open a file that need not stay open."""

    @contextmanager
    def opened(path: Path) -> Iterator[tuple[Table, ...]]:
        yield open_tables(path)

    return opened


def names_in(described: Recording | FrequencyResponse) -> list[str]:
    """Return the names of the channels, or of the points of frequency responses."""
    if isinstance(described, FrequencyResponse):
        return [point.name for point in described.points]
    return [channel.name for channel in described.channels]


@dataclass(frozen=True, eq=False)
class SurveyedColumn(PeekChannel):
    """A column of a file, and what is known of it.

    `values` (samples,) are as recorded, in `unit` ("" where the file says none), None where the
    file is none of time records; `overloads` of them were beyond the range. `quantity` is what it
    counts as, None where it is left out, `meant` what its name alone suggests.
    """

    values: FloatArray | None = None
    overloads: int = 0
    meant: Quantity | None = None
    described_unit: str = ""


@dataclass(frozen=True)
class Layout:
    """The layout by which files of one logger are recognised, and facts of this one.

    `hanger` and `has_rate` are what a profile must not say in its stead. `day_order`,
    `possible_times` and `local_time` are those of its table.
    """

    fingerprint: str
    format: str
    columns: tuple[str, ...]
    hanger: int | None = None
    has_rate: bool = False
    day_order: DayOrder | None = None
    possible_times: tuple[PossibleTime, ...] = ()
    local_time: datetime | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Survey(Peek):
    """A file as found, with all its columns and the layout of its logger."""

    columns: tuple[SurveyedColumn, ...]
    layout: Layout
    remarks: tuple[str, ...] = ()
