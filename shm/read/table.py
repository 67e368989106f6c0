"""Define what a format finds in a file: its columns, and the file's entries about them.

`open_table` of a format makes a `Table`; `describe` adds the sidecar; `assemble` makes the
recording. Peek, reading, import and its survey are uses of these three.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.header import Entry, Header, is_measured, stated_entries
from shm.read.stamps import DayOrder, PossibleTime
from shm.read.time_axis import REMEDY, Refusal
from shm.values import NAN

Role = Literal["channel", "response", "coherence", "times", "frequencies", "other"]
RAW_UNITS = ("counts", "full scale")
"""Units of a recorder, of which only its owner knows what one is worth."""


@dataclass(frozen=True, eq=False)
class Column:
    """A row of numbers in a file; `load` gives them as recorded, in `unit` ("" for unknown).

    `role` is what the file alone shows it to be, `stated` its entries by the keys of a
    sidecar, and `facts` those about the complete file. `rate_hz` is its rate, NaN without;
    `overloads` of its values were beyond the range. `label` names it where it is left out.
    `may_be_chosen` is False of what no person can make a channel.
    """

    name: str
    size: int
    load: Callable[[], Any]
    unit: str = ""
    role: Role = "other"
    stated: Mapping[str, Entry] = field(default_factory=dict)
    facts: Mapping[str, Entry] = field(default_factory=dict)
    rate_hz: float = NAN
    overloads: int = 0
    label: str = ""
    is_complex: bool = False
    may_be_chosen: bool = True

    @classmethod
    def of_logger(
        cls, name: str, unit: str, values: Any, path: Path, line: int | None = None, **more: Any
    ) -> Column:
        """Return a column of values, a channel where name and unit say what it measures."""
        stated = stated_entries(name, unit, path, line)
        if words.means_no_axis(name):
            more |= {"label": f"{name} (no axis)", "may_be_chosen": False}
            return cls(name, len(values), lambda: values, unit, "other", stated, **more)
        role: Role = "channel" if is_measured(name, unit) else "other"
        return cls(name, len(values), lambda: values, unit, role, stated, **more)


@dataclass(frozen=True, eq=False)
class Table:
    """A file as its format opens it: columns, and what it says of the whole in `entries`.

    `layout` are the words by which files of one logger are known. `left_out` names what is no
    column; `problems` are what should be mended, `remarks` what should be known. `record` names one
    of several records of a file, `day_order` is what its days prove of their order.
    """

    path: Path
    columns: tuple[Column, ...]
    entries: Mapping[str, Entry] = field(default_factory=dict)
    layout: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    record: str = ""
    possible_times: tuple[PossibleTime, ...] = ()
    day_order: DayOrder | None = None
    line_of: Callable[[int], int | None] = field(default=lambda row: None)
    refusal: BadInput | None = None
    local_time: datetime | None = None

    @property
    def source(self) -> str:
        """Return the name of file or record."""
        return str(self.path / self.record) if self.record else str(self.path)

    def uneven(self, column: Column) -> Refusal:
        """Return what makes the refusal of a sample of a column of times."""

        def refusal(row: int, what: str) -> BadInput:
            line = self.line_of(row)
            where = "" if line else f" at sample {row + 1}"
            return BadInput(
                f"{what}{where}.", file=self.path, channel=column.name, line=line, remedy=REMEDY
            )

        return refusal

    @property
    def choosable(self) -> list[Column]:
        """Return the columns that are, or may be, channels of a recording."""
        return [c for c in self.columns if c.may_be_chosen and c.role in ("channel", "other")]

    @property
    def file_header(self) -> Header:
        """Return what the file, or else its name, says of the whole."""
        measured = [c for c in self.columns if c.role in ("channel", "response")]
        return Header(self.path, {}, self.entries_with(measured))

    def entries_with(self, used: Sequence[Column]) -> dict[str, Entry]:
        found = dict(self.entries)
        for column in reversed(used):
            found.update(column.facts)
        hanger = words.hanger_numbered(self.path.stem)
        return found if hanger is None else {"hanger": Entry(hanger, self.path), **found}


@dataclass(frozen=True, eq=False)
class Description:
    """A table as file and sidecar describe it: `used` are its channels, or responses.

    The channels of `header` are those of `used`, in the same order. `more_times` are further
    columns of times, of which a logger writes one for each sensor.
    """

    table: Table
    header: Header
    used: tuple[Column, ...]
    is_response: bool
    times: Column | None
    seconds: float
    more_times: tuple[Column, ...]
    frequencies: Column | None
    left_out: tuple[str, ...]


def is_raw(column: Column, header: Header) -> bool:
    """Return whether nobody says what a recorder's count, or its full scale, is worth."""
    if column.name not in header.channels:
        return column.unit in RAW_UNITS
    return column.unit in RAW_UNITS and math.isnan(header.number("calibration", column.name))
