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
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from shm.documents import format_time
from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.content import LINE_BREAK, cells_of, mark_between
from shm.read.header import CHANNEL_KEYS, KEYS, entries_of, quantity_named
from shm.read.limits import refuse_long_header
from shm.read.logger_heading import (
    Heading,
    distinct_names,
    heading_of,
    leading_quantity,
    refuse_several_rates,
    stated_rate,
    unrounded,
    with_channel_units,
)
from shm.read.logger_rows import (
    DataRows,
    block_of,
    dialect_of,
    is_gap,
    is_number,
    is_over,
    values_of,
)
from shm.read.logger_times import Clock, clock_of, day_order_of
from shm.read.stamps import DayOrder, PossibleTime, is_stamp, possible_times, stamp_of
from shm.read.table import Column, Table
from shm.read.time_axis import rate_of
from shm.values import NAN

_PLAIN_NAME = set("abcdefghijklmnopqrstuvwxyz0123456789_")
_MOST_STACKED = 64  # judgement: four times the accelerations that are read
_HEAD = 20_000  # characters in which a heading of our own says so


def is_shm_csv(text: str) -> bool:
    """Return whether a text is CSV as `comma_separated` defines it: our keys, or names we know."""
    filled = [line.strip() for line in LINE_BREAK.split(text[:_HEAD]) if line.strip()]
    for place, line in enumerate(filled):
        if not line.strip('"').startswith("#"):
            return _names_bare(line, filled[place + 1] if place + 1 < len(filled) else "")
        key = line.strip('"').lstrip("# \t").partition(":")[0].strip().lower()
        if {key, key.rpartition(".")[2], key.partition(".")[0]} & _OUR_KEYS:
            return True
    return False


def _names_bare(line: str, below: str) -> bool:
    """Return whether a line names columns without units, and the line below holds no units."""
    mark = mark_between(line)
    cells, values = (cells_of(each.lower(), mark) for each in (line, below))
    bare = all(cell and set(cell) <= _PLAIN_NAME for cell in cells)
    known = bare and any(quantity_named(cell) for cell in cells)
    foreign = len(values) > len(cells) or (below != "" and not any(map(_may_be_value, values)))
    return known and not foreign


def _may_be_value(cell: str) -> bool:
    return is_over(cell) or is_gap(cell) or any(is_number(cell, mark) for mark in ".,")


_OUR_KEYS = {*KEYS, *CHANNEL_KEYS} - {"time", "coherence"}


def table_in(text: str, path: Path, preamble: Sequence[str] = ()) -> Table | None:
    """Return what a logger's text says; None where nothing in it looks like rows of numbers.

    `preamble` are lines that are said elsewhere, as on another sheet of a workbook. Raises BadInput
    naming line and column for rows that are damaged, and for times that are uneven.
    """
    lines = LINE_BREAK.split(text.rstrip("\x00\x1a"))
    stacked = _stacked(lines, path)
    if stacked is not None:
        return stacked
    parsed_text = _parsed(lines, path, preamble)
    return None if parsed_text is None else _table(*parsed_text, path, len(preamble))


def _parsed(
    lines: Sequence[str], path: Path, preamble: Sequence[str] = ()
) -> tuple[Heading, DataRows] | None:
    """Return the heading and the rows of a text; None where it has no rows."""
    dialect = dialect_of(lines)
    block = None if dialect is None else block_of(lines, dialect, path)
    if dialect is None or block is None:
        return None
    refuse_long_header(sum(map(len, block.above)), path)
    heading = heading_of((*preamble, *block.above), dialect)
    _refuse_split_decimals(heading, block, path)
    return heading, block


def _table(heading: Heading, block: DataRows, path: Path, before: int = 0) -> Table:
    """Return the table of a heading of which `before` lines are not in the file."""
    decimal = block.dialect.decimal
    rate = stated_rate(heading.facts, decimal)
    order = day_order_of(_days(heading), block)
    clock = clock_of(heading, block, rate, order, path)
    if clock.seconds is None:
        refuse_several_rates(heading.facts, decimal, path)
    time, is_local = clock.start, clock.is_local
    if time is None:
        time, is_local = _time(heading, order)
    layout = _layout(heading, block)  # without what is found in its lines: profiles know it so
    heading = with_channel_units(heading, block.above)
    line = max(0, heading.names_line - before) or None
    columns = [
        _column(heading, block, place, line, path)
        for place, kind in enumerate(block.dialect.kinds)
        if kind == "number" and place not in clock.used
    ]
    facts = {
        "hanger": _hanger(heading),
        "time": format_time(time),
        "temperature_c": _temperature(heading, decimal, columns),
        "sampling_rate_hz": rate,
    }
    found = Table(
        path,
        tuple(columns),
        entries_of(facts, path),
        layout,
        remarks=(*clock.remarks, *block.remarks),
        possible_times=() if time else clock.possible_starts or _possible_times(heading),
        day_order=order,
        line_of=lambda row: block.lines[row],
        local_time=time if is_local else None,
    )
    return found if clock.seconds is None else _timed(found, heading, clock, rate, decimal)


def _timed(table: Table, heading: Heading, clock: Clock, rate_hz: float, decimal: str) -> Table:
    """Return a table with its times, and a rate by them where that of the heading is rounded."""
    assert clock.seconds is not None
    times, *more = (
        Column(name, len(seconds), seconds.copy, "s", "times")
        for name, seconds in ((clock.name, clock.seconds), *clock.more)
    )
    entries = dict(table.entries)
    if not math.isnan(rate_hz):
        by_times = rate_of(clock.seconds, table.uneven(times), rate_hz)
        entries |= entries_of(
            {"sampling_rate_hz": unrounded(rate_hz, by_times, heading.facts, decimal)}, table.path
        )
    return replace(table, columns=(*table.columns, times, *more), entries=entries)


def _stacked(lines: Sequence[str], path: Path) -> Table | None:
    """Return signals of equal length one below the other, each under its own heading, as one table.

    Their first line is the same, and each heading says a title and a unit of its one signal. None
    for other texts.
    """
    first = next((line for line in lines if line.strip()), "")
    starts = [place for place, line in enumerate(lines) if line == first]
    if len(starts) < 2 or ":" not in first or len(starts) > _MOST_STACKED:
        return None
    tables, titles = [], []
    for a, b in pairwise([*starts, len(lines)]):
        part = _parsed(["", *lines[a + 1 : b]], path)
        table = None if part is None else _table(*part, path)
        if part is None or table is None or len(table.choosable) != 1:
            return None
        tables.append(table)
        titles.append(_of_one_signal(part[0], words.means_title))
    if len({_grid(table) for table in tables}) > 1:
        return None
    columns = tuple(
        replace(table.columns[0], name=name)
        for table, name in zip(tables, distinct_names(titles), strict=True)
    )
    units = [f"{column.name} [{column.unit}]" for column in columns]
    columns = (*columns, *tables[0].columns[1:])
    return replace(tables[0], columns=columns, layout=("stacked", *units))


def _grid(table: Table) -> tuple[object, ...]:
    """Return what equal times have in common."""
    times = [column.load()[-1] for column in table.columns if column.role == "times"]
    stated = table.entries.get("sampling_rate_hz")
    return table.columns[0].size, *times, stated.text if stated is not None else ""


def _column(heading: Heading, block: DataRows, place: int, line: int | None, path: Path) -> Column:
    values, overloads = values_of(block, place, path)
    name = heading.names[place]
    unit = heading.units[place] or ("" if heading.names_line else _unit_of_one(heading))
    return Column.of_logger(name, unit, values, path, line, overloads=overloads)


def _refuse_split_decimals(heading: Heading, block: DataRows, path: Path) -> None:
    """Raise BadInput where commas part both the cells and the decimals of the numbers."""
    dialect = block.dialect
    if dialect.mark != "," or dialect.quoted or not block.above:
        return
    named = max(
        (len([c for c in dialect.cells(line) if c]) for line in block.above[-3:]), default=0
    )
    if named > 1 and len(dialect.kinds) in (2 * named, 2 * named - 1) and heading.names_line == 0:
        raise BadInput(
            f"{len(dialect.kinds)} values in a row under {named} names: commas part the columns and"
            " the decimals too.",
            file=path,
            line=block.lines[0],
            remedy="Export with semicolons or tabs between the columns, or with decimal points.",
        )


# ---------------------------------------------------------------- facts of the whole


def _of_one_signal(heading: Heading, means: Callable[[str], bool]) -> str:
    return next((value for key, value in heading.facts if means(key)), "")


def _unit_of_one(heading: Heading) -> str:
    """Return the unit of the signal of a text that has one signal and names no columns."""
    unit = _of_one_signal(heading, words.means_unit)
    return unit if words.is_unit(unit) else ""


def _hanger(heading: Heading) -> int | None:
    """Return the hanger that the preamble numbers."""
    for key, value in heading.facts:
        if words.means_hanger(key) and value.strip().isdigit():
            return int(value)
    numbers = {
        n for fact in heading.facts if (n := words.hanger_numbered(" ".join(fact))) is not None
    }
    return numbers.pop() if len(numbers) == 1 else None


def _days(heading: Heading) -> list[str]:
    """Return all days and times of a heading, as written: the clocks, with each day, and the days.

    catman writes `T0 = ...`.
    """
    facts = [(key, value) for key, value in heading.facts if is_stamp(value)]
    days = [value for key, value in facts if words.means_date(key)]
    clocks = [v for key, v in facts if words.means_moment(key) or key.strip().upper() == "T0"]
    return [*clocks, *(f"{day} {clock}" for day in days for clock in clocks), *days]


def _time(heading: Heading, order: DayOrder | None) -> tuple[datetime | None, bool]:
    """Return the time that a heading says, and whether its clock names no zone."""
    for text in _days(heading):
        found = stamp_of(text)
        if found is not None and found.is_certain(order):
            return found.time(order), not found.has_zone
    return None, False


def _possible_times(heading: Heading) -> tuple[PossibleTime, ...]:
    """Return the times of a heading whose day can be read in several orders; empty for others."""
    return next((each for text in _days(heading) if (each := possible_times(text))), ())


def _temperature(heading: Heading, decimal: str, columns: Sequence[Column]) -> float:
    """Return the temperature that a preamble says, or the median of the column that is one."""
    for key, value in heading.facts:
        if words.means_temperature(key):
            number, unit = leading_quantity(value, decimal)
            if unit.lower() in ("", "°c", "c", "degc", "grad"):
                return number
    graded = [(words.temperature_meant(c.name), c) for c in columns if words.is_celsius(c.unit)]
    most = max((how_well for how_well, _ in graded), default=0)
    best = [column for how_well, column in graded if how_well and how_well == most]
    values = best[0].load() if len(best) == 1 else []
    return float(np.nanmedian(values)) if np.isfinite(values).any() else NAN


def _layout(heading: Heading, block: DataRows) -> tuple[str, ...]:
    """Return what files of one logger share: separator, decimal mark, keys, names and units.

    Serial numbers are included, as another device has other sensors; other values are not.
    """
    dialect = block.dialect
    keys = sorted({words.key_of(key) for key, _ in heading.facts if words.key_of(key)})
    serials = [value for key, value in heading.facts if words.means_serial(key)]
    columns = [f"{n} [{u}]" for n, u in zip(heading.names, heading.units, strict=True)]
    return (f"{dialect.mark}{dialect.decimal}", *keys, *serials, *columns)
