"""Text as any logger writes it: free lines, a heading of one or several rows, then numbers.

    Messung;Probe 12                         HBM, National Instruments, Dewesoft, spreadsheets ...
    Abtastrate;1200 Hz
    Zeit [s];Kraft [N];Beschl. 1 [m/s²]
    0,00000;-0,12;0,0031

Nothing is guessed that a frequency or a tension depends on: a column without a unit is left for the
sidecar to describe (see `shm import`), times without a unit need a rate that agrees with them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from shm.documents import format_time
from shm.errors import BadInput
from shm.read import assemble
from shm.read import logger_words as words
from shm.read.base import LoggerColumn, LoggerTable, Peek
from shm.read.comma_table import LINE_BREAK, REMEDY, cells_of, mark_between, rate_of
from shm.read.header import Entry, Header, quantity_named
from shm.read.limits import refuse_long_header
from shm.read.logger_heading import Heading, heading_of, quantity_said, rate_said, unlike, unrounded
from shm.read.logger_rows import (
    Block,
    block_of,
    is_gap,
    is_number,
    is_over,
    script_of,
    values_of,
)
from shm.read.logger_times import Clock, clock_of, day_order_of
from shm.read.logger_words import UNSAID
from shm.read.sidecar import channels_described, with_sidecar
from shm.read.stamps import DayOrder, PossibleTime, moment, parsed, possible_times
from shm.values import NAN, FloatArray, Recording

_PLAIN_NAME = set("abcdefghijklmnopqrstuvwxyz0123456789_")
_LISTED = re.compile(r"TIMESERIES .*?, *(\d+) samples,")  # SLIST and TSPAIR, of seismology
_MOST_STACKED = 64  # judgement: four times the accelerations that are read
_HEAD = 20_000  # characters in which a heading of our own says so


def is_ours(text: str) -> bool:
    """Whether a text is CSV as `comma_separated` describes it: our keys, or bare names we know."""
    filled = [line.strip() for line in LINE_BREAK.split(text[:_HEAD]) if line.strip()]
    for place, line in enumerate(filled):
        if not line.strip('"').startswith("#"):
            return _names_bare(line, filled[place + 1] if place + 1 < len(filled) else "")
        key = line.strip('"').lstrip("# \t").partition(":")[0].strip().lower()
        if {key, key.rpartition(".")[2], key.partition(".")[0]} & _OUR_KEYS:
            return True
    return False


def _names_bare(line: str, below: str) -> bool:
    """Whether a line names columns as our own do, and what is below it are not units."""
    mark = mark_between(line)
    cells, values = (cells_of(each.lower(), mark) for each in (line, below))
    bare = all(cell and set(cell) <= _PLAIN_NAME for cell in cells)
    known = bare and any(quantity_named(cell) for cell in cells)
    foreign = len(values) > len(cells) or (below != "" and not any(map(_may_be_value, values)))
    return known and not foreign


def _may_be_value(cell: str) -> bool:
    return is_over(cell) or is_gap(cell) or any(is_number(cell, mark) for mark in ".,")


_OUR_KEYS = {
    "hanger", "temperature_c", "added_mass_kg", "added_mass_at_m", "added_mass_radius_m",
    "sampling_rate_hz", "unit", "x_m", "plane", "calibration", "full_scale", "leave_out",
}  # fmt: skip


def parse(text: str, path: Path, preamble: Sequence[str] = ()) -> LoggerTable | None:
    """What a logger's text says; None where nothing in it looks like rows of numbers.

    `preamble` are lines that are said elsewhere, as on another sheet of a workbook.

    Raises BadInput naming line and column for rows that are damaged, and for times that are uneven.
    """
    lines = LINE_BREAK.split(text.rstrip("\x00\x1a"))
    stacked = _stacked(lines, path)
    if stacked is not None:
        return stacked
    script = script_of(lines)
    block = None if script is None else block_of(lines, script, path)
    if script is None or block is None:
        return None
    refuse_long_header(sum(map(len, block.above)), path)
    heading = heading_of((*preamble, *block.above), script)
    _refuse_split_decimals(heading, block, path)
    rate = rate_said(heading.facts, script.decimal)
    order = day_order_of(_days(heading), block)
    clock = clock_of(heading, block, rate, order, path)
    time = clock.start or _time(heading, order)
    _refuse_wrapped(block, path)
    columns = tuple(
        _column(heading, block, clock, place, path)
        for place, kind in enumerate(script.kinds)
        if kind == "number" and place not in clock.used
    )
    return LoggerTable(
        columns=columns,
        said_rate_hz=unrounded(rate, clock.rate_hz, heading.facts, script.decimal),
        times_rate_hz=clock.rate_hz,
        hanger=_hanger(heading, path),
        time=time,
        temperature_c=_temperature(heading, script.decimal),
        names_line=max(0, heading.names_line - len(preamble)),
        layout=_layout(heading, block),
        title=_of_one_signal(heading, words.means_title),
        remarks=(*clock.remarks, *block.remarks),
        possible_times=() if time else clock.possible_starts or _possible_times(heading),
        day_order=order,
    )


def _stacked(lines: Sequence[str], path: Path) -> LoggerTable | None:
    """Signals of equal length one below the other, each under its own heading; None for others.

    Their first line is the same, and each heading says a title and a unit of its one signal.
    """
    first = next((line for line in lines if line.strip()), "")
    starts = [place for place, line in enumerate(lines) if line == first]
    if len(starts) < 2 or ":" not in first or len(starts) > _MOST_STACKED:
        return None
    parts = [lines[a:b] for a, b in pairwise([*starts, len(lines)])]
    tables = [parse("\n".join(["", *part[1:]]), path) for part in parts]
    found = [table for table in tables if table is not None and len(table.columns) == 1]
    if len(found) < len(tables) or len({t.samples for t in found}) > 1:
        return None
    if len({(str(t.said_rate_hz), str(t.times_rate_hz)) for t in found}) > 1:
        return None
    columns = tuple(
        replace(table.columns[0], name=name)
        for table, name in zip(found, unlike([t.title for t in found]), strict=True)
    )
    units = [f"{c.name} [{c.unit}]" for c in columns]
    return replace(found[0], columns=columns, layout=("stacked", *units))


def _column(heading: Heading, block: Block, clock: Clock, place: int, path: Path) -> LoggerColumn:
    values, overloads = values_of(block, place, path)
    return LoggerColumn(
        heading.names[place],
        heading.units[place] or ("" if heading.names_line else _unit_of_one(heading)),
        clock.evened(values),
        overloads,
        heading.sensitivities[place],
    )


def _refuse_split_decimals(heading: Heading, block: Block, path: Path) -> None:
    """Raises BadInput where commas part both the cells and the decimals of the numbers."""
    script = block.script
    if script.mark != "," or script.quoted or not block.above:
        return
    named = max((len([c for c in script.cells(line) if c]) for line in block.above[-3:]), default=0)
    if named > 1 and len(script.kinds) in (2 * named, 2 * named - 1) and heading.names_line == 0:
        raise BadInput(
            f"{len(script.kinds)} values in a row under {named} names: commas part the columns and"
            " the decimals too.",
            file=path,
            line=block.lines[0],
            remedy="Export with semicolons or tabs between the columns, or with decimal points.",
        )


def _refuse_wrapped(block: Block, path: Path) -> None:
    """Raises BadInput where a list of a seismic archive says another number of samples."""
    said = next((int(found[1]) for line in block.above if (found := _LISTED.match(line))), None)
    if said is not None and said != len(block.rows):
        raise BadInput(
            f"its heading says {said} samples of one channel, where {len(block.rows)} rows of"
            f" {len(block.script.kinds)} values follow.",
            file=path,
            line=block.lines[0],
            remedy="Export one column for each channel, or as miniSEED.",
        )


# ---------------------------------------------------------------- facts of the whole


def _of_one_signal(heading: Heading, means: Callable[[str], bool]) -> str:
    return next((value for key, value in heading.facts if means(key)), "")


def _unit_of_one(heading: Heading) -> str:
    """The unit of the signal of a text that has one signal and names no columns."""
    unit = _of_one_signal(heading, words.means_unit)
    return unit if words.is_unit(unit) else ""


def _hanger(heading: Heading, path: Path) -> int | None:
    """The hanger that the preamble numbers, or else the file's name."""
    for key, value in heading.facts:
        if words.means_hanger(key) and value.strip().isdigit():
            return int(value)
    said = {n for fact in heading.facts if (n := words.hanger_numbered(" ".join(fact))) is not None}
    return said.pop() if len(said) == 1 else words.hanger_numbered(path.stem)


def _dates(heading: Heading) -> list[str]:
    return [v for k, v in heading.facts if words.means_date(k) and parsed(v)]


def _moments(heading: Heading) -> list[str]:
    return [v for k, v in heading.facts if words.means_moment(k) and parsed(v)]


def _days(heading: Heading) -> list[str]:
    """Return all days and times of a heading, as they are written."""
    return [*_dates(heading), *_moments(heading)]


def _time(heading: Heading, order: DayOrder | None) -> datetime | None:
    days, clocks = _dates(heading), _moments(heading)
    whole = [v for v in clocks if moment("", v, order) is not None]
    if whole:
        return moment("", whole[0], order)
    return moment(days[0], clocks[0] if clocks else "", order) if days else None


def _possible_times(heading: Heading) -> tuple[PossibleTime, ...]:
    """Return the times of a heading whose day can be read in several orders; empty for others."""
    days, clocks = _dates(heading), _moments(heading)
    texts = [*clocks, *(f"{day} {clock}" for day in days for clock in clocks), *days]
    return next((each for text in texts if (each := possible_times(text))), ())


def _temperature(heading: Heading, decimal: str) -> float:
    for key, value in heading.facts:
        if words.means_temperature(key):
            number, unit = quantity_said(value, decimal)
            if unit.lower() in ("", "°c", "c", "degc", "grad"):
                return number
    return NAN


def _layout(heading: Heading, block: Block) -> tuple[str, ...]:
    """What all files of one logger share: how they are written, keys, names and units; no values.

    But the serial numbers, as another device has other sensors.
    """
    script = block.script
    keys = sorted({words.key_of(key) for key, _ in heading.facts if words.key_of(key)})
    serials = [value for key, value in heading.facts if words.means_serial(key)]
    columns = [f"{n} [{u}]" for n, u in zip(heading.names, heading.units, strict=True)]
    return (f"{script.mark}{script.decimal}", *keys, *serials, *columns)


# ---------------------------------------------------------------- to a header


def header_of(table: LoggerTable, path: Path) -> tuple[Header, list[int], tuple[str, ...]]:
    """The header of a table with its sidecar, the places of its channels, names left out.

    A channel is what is in a unit of force or acceleration, in volts of a sensor whose sensitivity
    the file says, or described by the sidecar.
    """
    described = channels_described(path)
    used = [
        place
        for place, column in enumerate(table.columns)
        if (column.name in described and not _described_seconds(described[column.name]))
        or (column.name not in described and is_measured(column))
    ]
    channels = {
        table.columns[place].name: _entries(table.columns[place], table.names_line, path)
        for place in used
    }
    out = tuple(c.name for place, c in enumerate(table.columns) if place not in used)
    said = {
        "hanger": table.hanger,
        "time": format_time(table.time),
        "temperature_c": None if math.isnan(table.temperature_c) else table.temperature_c,
        "sampling_rate_hz": None if math.isnan(table.said_rate_hz) else table.said_rate_hz,
    }
    entries = {key: Entry(value, path) for key, value in said.items() if value is not None}
    return with_sidecar(Header(path, channels, entries), path, out), used, out


def _described_seconds(entries: Mapping[str, Entry]) -> float | None:
    """Return the seconds of a unit of time that a sidecar gives a column; None of other units."""
    return words.seconds_of(entries["unit"].text) if "unit" in entries else None


def is_measured(column: LoggerColumn) -> bool:
    """Whether a file itself says that a column is a force or an acceleration, and in what unit."""
    measured = words.unit_of(column.unit) is not None and not _is_doubtful(column)
    return measured or (words.volts_of(column.unit) is not None and column.sensitivity is not None)


def _is_doubtful(column: LoggerColumn) -> bool:
    """Whether a load cell, by its name, is in a unit of acceleration: g may be its grams."""
    unit = words.unit_of(column.unit)
    in_g = unit is not None and unit.quantity == "acceleration"
    return in_g and words.means_force_alone(column.name)


def _entries(column: LoggerColumn, line: int, path: Path) -> dict[str, Entry]:
    said: dict[str, object] = {"unit": column.unit}
    volts = words.volts_of(column.unit)
    if volts is not None and column.sensitivity is not None:
        said["unit"] = column.sensitivity.unit
        said["calibration"] = column.sensitivity.unit_per_volt * volts
    elif _is_doubtful(column) or (quantity_named(column.name) and not column.unit):
        said["unit"] = UNSAID  # a name such as force promises newtons in our own files alone
    plane = words.plane_meant(column.name)
    if plane is not None and (unit := words.unit_of(str(said["unit"]))) is not None:
        said |= {"plane": plane} if unit.quantity == "acceleration" else {}
    return {key: Entry(value, path, line or None) for key, value in said.items() if value}


def recording(table: LoggerTable, path: Path) -> Recording:
    """The recording that a table holds, described by file and sidecar; raises BadInput."""
    header, used, _ = header_of(table, path)
    rate = told_rate(table, header, path)
    found = assemble.recording(header, _values(table, used), path, rate)
    return found if found.time else replace(found, possible_times=_distinct_times(table))


def peeked(table: LoggerTable, file_format: str, path: Path) -> Peek:
    """What the headers say; faults become problems."""
    header, _, out = header_of(table, path)
    look = assemble.peeked(
        header, file_format, table.samples, lambda: told_rate(table, header, path), path,
        left_out=out,
    )  # fmt: skip
    return look if look.time else replace(look, possible_times=_distinct_times(table))


def _distinct_times(table: LoggerTable) -> tuple[datetime, ...]:
    """Return the possible times of a table, each once: two orders may have the same day."""
    return tuple(dict.fromkeys(each.time for each in table.possible_times))


def _values(table: LoggerTable, used: Sequence[int]) -> FloatArray:
    """The values of channels (channels, samples), as recorded."""
    if not used:
        return np.zeros((0, table.samples))
    return np.array([table.columns[place].values for place in used])


def told_rate(table: LoggerTable, header: Header, path: Path) -> float:
    """What the times tell, where that is to be held against what is said; NaN where both agree.

    A column of times is rounded to its last digit, and a preamble's rate is the one that was set.
    """
    entry = header.entries.get("sampling_rate_hz")
    if entry is None and math.isnan(table.times_rate_hz):
        return _described_rate(table, path)
    said = table.said_rate_hz
    agree = abs(table.times_rate_hz - said) <= _SAME * said
    return NAN if agree and entry is not None and entry.file == path else table.times_rate_hz


def _described_rate(table: LoggerTable, path: Path) -> float:
    """Return the rate by the column that the sidecar gives a unit of time; NaN where none has."""
    for name, entries in channels_described(path).items():
        seconds = _described_seconds(entries)
        column = next((each for each in table.columns if each.name == name), None)
        if seconds is not None and column is not None:
            fault = _refusal_of_times(path, name)
            return rate_of(column.values * seconds, fault)
    return NAN


def _refusal_of_times(path: Path, name: str) -> Callable[[int, str], BadInput]:
    return lambda row, what: BadInput(
        f"{what} at sample {row + 1}.", file=path, channel=name, remedy=REMEDY
    )


_SAME = 1e-3  # judgement: of the rate; a frequency that is off by so little moves no tension
