"""A file as a table of columns, before it is known which of them is what."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from shm.read.logger_words import Sensitivity
from shm.values import FloatArray


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
