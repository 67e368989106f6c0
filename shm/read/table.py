"""Define what a format finds in a file: its columns, and the file's entries about them.

`open_table` of a format makes a `Table`; `describe` adds the sidecar; `assemble` makes the
recording. Peek, reading, import and its survey are uses of these three.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.header import Entry, Header
from shm.read.sidecar import channels_described, with_sidecar
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
        return Header(self.path, {}, self._entries(measured))

    def _entries(self, used: Sequence[Column]) -> dict[str, Entry]:
        found = dict(self.entries)
        for column in reversed(used):
            found.update(column.facts)
        hanger = words.hanger_numbered(self.path.stem)
        return found if hanger is None else {"hanger": Entry(hanger, self.path), **found}


@dataclass(frozen=True, eq=False)
class Description:
    """A table as file and sidecar describe it: `used` are its channels, or responses.

    The channels of `header` are those of `used`, in the same order.
    """

    table: Table
    header: Header
    used: tuple[Column, ...]
    is_response: bool
    times: Column | None
    seconds: float
    frequencies: Column | None
    left_out: tuple[str, ...]


def describe(table: Table, *, with_sidecars: bool = True) -> Description:
    """Return the table with what its sidecar says; raises BadInput where that is faulty."""
    in_sidecar = channels_described(table.path) if with_sidecars else {}
    roles = {column.name: role_of(column, in_sidecar.get(column.name)) for column in table.columns}
    channels, responses = (
        [column for column in table.columns if roles[column.name] == role]
        for role in ("channel", "response")
    )
    # Time records go before frequency responses, but not a force alone.
    recorded = any(not column.name.lower().startswith("force") for column in channels)
    is_response = bool(responses) and not recorded
    found = responses if is_response else channels
    others = [column for column in table.columns if column not in found]
    header = Header(table.path, {c.name: c.stated for c in found}, table._entries(found))
    if with_sidecars:
        known = [*(column.name for column in others), *table.left_out]
        header = with_sidecar(header, table.path, known)
    out = [column for column in found if header.leaves_out(column.name)]
    used = tuple(column for column in found if column not in out)
    size = next((column.size for column in used or table.choosable), 0)
    fitting = [column for column in others if column.size == size]
    times = next((c for c in fitting if roles[c.name] == "times"), None)
    frequencies = next((c for c in fitting if roles[c.name] == "frequencies"), None)
    unit = _text(in_sidecar.get(times.name, {}), "unit") or times.unit if times else ""
    idle = [
        column
        for column in others
        if roles[column.name] == "other"
        or (roles[column.name] in ("times", "frequencies") and column.name in in_sidecar)
    ]
    named = [c.label or c.name for c in idle if c is not times and c is not frequencies]
    return Description(
        table,
        replace(header, channels={c.name: header.channels[c.name] for c in used}),
        used,
        is_response,
        times,
        words.seconds_of(unit) or 1.0,
        frequencies,
        (*named, *table.left_out, *(column.name for column in out)),
    )


def role_of(column: Column, described: Mapping[str, Entry] | None) -> Role:
    """Return the role of a column that a sidecar describes so (None: not at all).

    Its unit goes before its name.
    """
    if described is None:
        return column.role
    if _text(described, "leave_out").lower() == "true":
        return column.role if column.role in ("channel", "response") else "other"
    unit = _text(described, "unit") or column.unit
    if column.is_complex:
        return "response" if column.role == "response" or is_accelerance(unit) else "other"
    if words.seconds_of(unit) is not None:
        return "times"
    if unit.strip(" []()").lower() == "hz":
        return "frequencies"
    return "coherence" if column.role == "coherence" else "channel"


def is_accelerance(unit: str) -> bool:
    """Return whether a unit is one of acceleration over force."""
    return "/" in unit.replace(")(", ")/(") and words.accelerance_si(unit, "") is not None


def is_raw(column: Column, header: Header) -> bool:
    """Return whether nobody says what a recorder's count, or its full scale, is worth."""
    if column.name not in header.channels:
        return column.unit in RAW_UNITS
    return column.unit in RAW_UNITS and math.isnan(header.calibration(column.name))


def _text(described: Mapping[str, Entry], key: str) -> str:
    return described[key].text if key in described else ""
