"""The columns of times of a logger's text: seconds, milliseconds, clock times, counters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.logger_rows import DataRows, values_of
from shm.read.stamps import (
    DayOrder,
    PossibleTime,
    find_day_order,
    follow_days,
    names_zone,
    possible_times,
    seconds_of_stamps,
    stamp_of,
    without_clock_change,
)
from shm.read.time_axis import REMEDY
from shm.values import NAN, FloatArray

if TYPE_CHECKING:
    from shm.read.logger_heading import Heading

# Judgement: no logger records a hammer test slower than this, and none faster.
_SLOWEST_HZ, _FASTEST_HZ = 20.0, 200_000.0
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3), (1e8, 1.0))  # least value and its unit in s
_EVEN = 0.1  # judgement: of a step, which may be rounded


@dataclass(frozen=True, eq=False)
class Clock:
    """The times of the rows, in `seconds`, by the column `name`; None where none tells them.

    `more` are further columns of times, by name and in s; `used` the columns without a measurement.
    `possible_starts` are several where the day of the start can be read in several orders;
    `is_local` says that the start is by a clock that names no zone.
    """

    used: frozenset[int]
    name: str = ""
    seconds: FloatArray | None = None
    more: tuple[tuple[str, FloatArray], ...] = ()
    start: datetime | None = None
    possible_starts: tuple[PossibleTime, ...] = ()
    is_local: bool = False
    remarks: tuple[str, ...] = ()


def clock_of(
    heading: Heading, block: DataRows, stated_hz: float, order: DayOrder | None, path: Path
) -> Clock:
    """Return the times of the rows; raises BadInput naming the line of a stamp that is none.

    `stated_hz` is the rate by the preamble, which decides in what unit times are that have none;
    `order` that of the file's days.
    """
    stamps = [i for i, kind in enumerate(block.dialect.kinds) if kind == "stamp"]
    numbers = [i for i, kind in enumerate(block.dialect.kinds) if kind == "number"]
    kinds = {i: _kind_of(heading, block, i, stated_hz, path) for i in numbers}
    times = [i for i, kind in kinds.items() if kind == "times"]
    clock = Clock(frozenset([*stamps, *(i for i, kind in kinds.items() if kind)]))
    for place in times:
        values, _ = values_of(block, place, path)
        found = _since_start(values, heading.units[place], stated_hz)
        if found is not None:
            seconds, start = found
            clock = replace(clock, name=heading.names[place], seconds=seconds, start=start)
            clock = replace(clock, more=tuple(_more(heading, block, times, place, stated_hz, path)))
            return clock if start or not stamps else _started(clock, _stamps(block, 0)[0], order)
    if stamps:
        return _of_stamps(clock, heading.names[stamps[0]], block, order, path)
    remarks = (f"the unit of {heading.names[times[0]]} is not said; left out.",) if times else ()
    return replace(clock, remarks=remarks)


def _more(
    heading: Heading, block: DataRows, times: Sequence[int], used: int, stated_hz: float, path: Path
) -> Iterator[tuple[str, FloatArray]]:
    """Yield name and seconds of further columns of times; NaN where one has ended."""
    for place in times:
        values, _ = values_of(block, place, path)
        known = np.isfinite(values)
        found = _since_start(values[known], heading.units[place], stated_hz)
        if place > used and found is not None:
            seconds = np.full(len(values), NAN)
            seconds[known] = found[0]
            yield heading.names[place], seconds


def day_order_of(days: Sequence[str], block: DataRows) -> DayOrder | None:
    """Return the order that the days of a heading, or of the first and last row, prove.

    None where none of them does, or where they contradict each other.
    """
    ends = [*_stamps(block, 0), *_stamps(block, -1)]
    return find_day_order([*days, *ends]) or (follow_days(*ends) if ends else None)


def _stamps(block: DataRows, row: int | None = None) -> list[str]:
    """Return day and clock time of each row, or of one; empty without columns of such."""
    columns = [i for i, kind in enumerate(block.dialect.kinds) if kind == "stamp"]
    rows = (block.rows if row is None else [block.rows[row]]) if columns else []
    return [" ".join(cells[i] for i in columns) for cells in rows]


def _kind_of(heading: Heading, block: DataRows, place: int, stated_hz: float, path: Path) -> str:
    """Return "times" or "counter" of a column that measures nothing, "" of any other.

    A column without a name is one of times where it increases by the stated step, or, in the first
    place, by even steps below one; else a first one with even steps counts the rows.
    """
    name, unit = heading.names[place], heading.units[place]
    in_seconds = words.seconds_of(unit) is not None
    if (words.means_time(name) and (in_seconds or not unit)) or (in_seconds and place == 0):
        return "times"
    is_nameless, counts = name == f"column_{place + 1}", words.means_counter(name)
    if not is_nameless and not counts:
        return ""
    steps = np.diff(values_of(block, place, path)[0])
    if not (len(steps) and steps[0] > 0 and np.all(abs(steps - steps[0]) <= _EVEN * steps[0])):
        return ""
    is_times = steps[0] < 1 and place == 0
    if not math.isnan(stated_hz):
        is_times = abs(steps[0] * stated_hz - 1) < _EVEN
    if is_nameless and is_times:
        return "times"
    return "counter" if counts or place == 0 else ""


def _since_start(
    values: FloatArray, unit: str, stated_hz: float
) -> tuple[FloatArray, datetime | None] | None:
    """Return seconds since the start, and the start if known; None where their unit is unknown."""
    if len(values) < 2 or not np.isfinite(values).all():
        return None
    factor = words.seconds_of(unit)
    for least, of_epoch in _EPOCHS:  # times since 1970
        if least < values[0] < 50 * least and factor in (None, of_epoch):
            start = datetime.fromtimestamp(float(values[0]) * of_epoch, UTC)
            return of_epoch * (values - values[0]), start
    if factor is None:
        factor = _factor(values, stated_hz)
    return None if factor is None else (factor * (values - values[0]), None)


def _factor(values: FloatArray, stated_hz: float) -> float | None:
    """Return the unit in s of times without a unit: by the stated rate, else s if possible."""
    span = float(values[-1] - values[0])
    if not span > 0:
        return None
    rate = (len(values) - 1) / span
    for factor in (1.0, 1e-3, 1e-6):
        if abs(rate / factor / stated_hz - 1) < 0.01:
            return factor
    # In s, too, where that contradicts what is said: it is refused then.
    return 1.0 if _SLOWEST_HZ <= rate <= _FASTEST_HZ else None


def _started(clock: Clock, stamp: str, order: DayOrder | None) -> Clock:
    """Return a clock with the start that its first stamp tells, or all where its day is unsure."""
    found, local = stamp_of(stamp), not names_zone(stamp)
    if found is not None and found.is_certain(order):
        return replace(clock, start=found.time(order), is_local=local)
    return replace(clock, possible_starts=possible_times(stamp), is_local=local)


def _of_stamps(
    clock: Clock, name: str, block: DataRows, order: DayOrder | None, path: Path
) -> Clock:
    texts = _stamps(block)
    seconds = seconds_of_stamps(texts, order)
    if len(wrong := np.flatnonzero(np.isnan(seconds))):
        raise BadInput(
            f"{texts[wrong[0]][:40]!r} is no time.",
            file=path,
            channel=name,
            line=block.lines[wrong[0]],
            remedy=REMEDY,
        )
    seconds, place = without_clock_change(seconds)
    clock = _started(replace(clock, name=name, seconds=seconds), texts[0], order)
    if place is None:
        return clock
    what = f"the clock went back one hour at line {block.lines[place]}: the end of summer time."
    return replace(clock, remarks=(what,))
