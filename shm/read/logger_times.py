"""The columns of times of a logger's text: seconds, milliseconds, clock times, counters."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.logger_heading import Heading
from shm.read.logger_rows import DataRows, second_record, values_of
from shm.read.stamps import (
    DayOrder,
    PossibleTime,
    find_day_order,
    follow_days,
    names_zone,
    parsed,
    possible_times,
    seconds_of_stamps,
    without_clock_change,
)
from shm.read.time_axis import REMEDY, on_even_grid
from shm.values import NAN, FloatArray

# Judgement: no logger records a hammer test slower than this, and none faster.
_SLOWEST_HZ, _FASTEST_HZ = 20.0, 200_000.0
_LEAST_EPOCH_S, _EPOCHS = 1e8, ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3), (1e8, 1.0))
_SHEET_DAYS = (30_000.0, 60_000.0)  # 1982 to 2064, as spreadsheets count days
_SHEET_START = datetime(1899, 12, 30, tzinfo=UTC)  # day 0 of spreadsheets
_EVEN = 0.1  # judgement: of a step, which may be rounded
_FINE = 1e-4  # judgement: of the span; times rounded more coarsely do not give the rate alone


@dataclass(frozen=True, eq=False)
class Clock:
    """Rate and start by the columns of times; `used` are the columns without a measurement.

    `possible_starts` are several where the day of the start can be read in several orders;
    `is_local` says that the start is by a clock that names no zone.
    """

    used: frozenset[int]
    rate_hz: float = NAN
    start: datetime | None = None
    possible_starts: tuple[PossibleTime, ...] = ()
    resampled: Callable[[FloatArray], FloatArray] = lambda values: values
    remarks: tuple[str, ...] = ()
    is_local: bool = False


def clock_of(
    heading: Heading, block: DataRows, stated_hz: float, order: DayOrder | None, path: Path
) -> Clock:
    """Return the times of the rows; raises BadInput naming the line where they are uneven.

    `stated_hz` is the rate by the preamble, which decides in what unit times are that have none;
    `order` that of the file's days.
    """
    stamps = _stamp_columns(block)
    numbers = [i for i, kind in enumerate(block.dialect.kinds) if kind == "number"]
    times = [
        i
        for i in numbers
        if _is_time(heading, i) or _keeps_step(heading, block, i, stated_hz, path)
    ]
    counters = [i for i in numbers if i not in times and _is_counter(heading, block, i, path)]
    if not times and not stamps and counters and math.isnan(stated_hz):
        times = _nameless_times(heading, block, counters, path)
    used = frozenset([*stamps, *times, *counters])
    if block.seam and not times and not stamps:
        raise second_record(block.seam, path)
    for place in times:
        found = _of_numbers(heading, block, place, stated_hz, path)
        if found is not None:
            seconds, start = found
            clock = _even(seconds, stated_hz, start, used, heading.names[place], block, path)
            return clock if start or not stamps else _started(clock, _stamps(block, 0), order)
    if stamps:
        texts = _stamps(block)
        return _of_stamps(texts, stated_hz, order, used, heading.names[stamps[0]], block, path)
    remarks = (f"the unit of {heading.names[times[0]]} is not said; left out.",) if times else ()
    return Clock(used, remarks=remarks)


def day_order_of(days: Sequence[str], block: DataRows) -> DayOrder | None:
    """Return the order that the days of a heading, or of the first and last row, prove.

    None where none of them does, or where they contradict each other.
    """
    ends = [text for row in (0, -1) for text in _stamps(block, row)]
    return find_day_order([*days, *ends]) or (follow_days(ends) if ends else None)


def _stamp_columns(block: DataRows) -> list[int]:
    return [i for i, kind in enumerate(block.dialect.kinds) if kind == "stamp"]


def _stamps(block: DataRows, row: int | None = None) -> list[str]:
    """Return day and clock time of each row, or of one; empty without columns of such."""
    columns = _stamp_columns(block)
    rows = (block.rows if row is None else [block.rows[row]]) if columns else []
    return [" ".join(cells[i] for i in columns) for cells in rows]


def _is_time(heading: Heading, place: int) -> bool:
    unit = heading.units[place]
    named = words.means_time(heading.names[place])
    in_seconds = words.seconds_of(unit) is not None
    return (named and (in_seconds or not unit)) or (in_seconds and place == 0)


def _keeps_step(
    heading: Heading, block: DataRows, place: int, stated_hz: float, path: Path
) -> bool:
    """Return whether a column without a name increases by the step that the preamble gives."""
    if math.isnan(stated_hz) or heading.names[place] != f"column_{place + 1}":
        return False
    values, _ = values_of(block, place, path)
    steps = np.diff(values)
    return bool(len(steps) and np.all(np.abs(steps * stated_hz - 1) < _EVEN))


def _is_counter(heading: Heading, block: DataRows, place: int, path: Path) -> bool:
    """Return whether a column counts the rows: by its name, or in the first place without a name.

    Its steps may differ by the rounding of the last digit, as those of times do.
    """
    named = words.means_counter(heading.names[place])
    if not named and not (place == 0 and heading.names[place] == "column_1"):
        return False
    values, _ = values_of(block, place, path)
    steps = np.diff(values)
    if not len(steps) or not steps[0] > 0:
        return False
    return bool(np.all(np.abs(steps - steps[0]) <= _EVEN * steps[0]))


def _nameless_times(
    heading: Heading, block: DataRows, counters: list[int], path: Path
) -> list[int]:
    """Return a nameless first column with even steps below one, which no counter has, as times."""
    first = counters[0]
    values, _ = values_of(block, first, path)
    is_times = heading.names[first] == "column_1" and 0 < values[1] - values[0] < 1
    return [first] if is_times else []


def _of_numbers(
    heading: Heading, block: DataRows, place: int, stated_hz: float, path: Path
) -> tuple[FloatArray, datetime | None] | None:
    """Return seconds since the start, and the start if known; None where their unit is unknown."""
    values, _ = values_of(block, place, path)
    if len(values) < 2 or not np.isfinite(values).all():
        return None
    factor = words.seconds_of(heading.units[place])
    if factor is None or values[0] > _LEAST_EPOCH_S:
        since = _since_epoch(values)
        if since is not None:
            return since
    if factor is None:
        factor = _factor(values, stated_hz)
    return None if factor is None else (factor * (values - values[0]), None)


def _since_epoch(values: FloatArray) -> tuple[FloatArray, datetime] | None:
    """Return the seconds and the start of times since 1970 (seconds) or 1900 (days)."""
    first, step = float(values[0]), float(np.median(np.diff(values)))
    if _SHEET_DAYS[0] < first < _SHEET_DAYS[1] and 0 < step * 86400 < 1:
        return 86400 * (values - first), _SHEET_START + timedelta(days=first)
    for least, factor in _EPOCHS:
        if least < first < 50 * least:
            start = datetime.fromtimestamp(first * factor, UTC)
            return factor * (values - first), start
    return None


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


def _started(clock: Clock, stamps: Sequence[str], order: DayOrder | None) -> Clock:
    """Return a clock with the start that its first stamp tells, or all where its day is unsure."""
    found = parsed(stamps[0], order)
    local = not names_zone(stamps[0])
    if found is not None and found[1]:
        return replace(clock, start=found[0], is_local=local)
    return replace(clock, possible_starts=possible_times(stamps[0]), is_local=local)


def _of_stamps(
    texts: list[str], stated_hz: float, order: DayOrder | None, used: frozenset[int],
    name: str, block: DataRows, path: Path,
) -> Clock:  # fmt: skip
    seconds = seconds_of_stamps(texts, order)
    if seconds is None:
        wrong = next(place for place, text in enumerate(texts) if parsed(text) is None)
        raise _fault(block, name, path)(wrong, f"{texts[wrong][:40]!r} is no time")
    seconds, place = without_clock_change(seconds)
    found = _started(_even(seconds, stated_hz, None, used, name, block, path), texts, order)
    if place is None:
        return found
    what = f"the clock went back one hour at line {block.lines[place]}: the end of summer time."
    return replace(found, remarks=(*found.remarks, what))


def _even(
    seconds: FloatArray, stated_hz: float, start: datetime | None, used: frozenset[int],
    name: str, block: DataRows, path: Path,
) -> Clock:  # fmt: skip
    """Return the clock of seconds that may be rounded so that several rows have the same."""
    fault = _fault(block, name, path)
    back = np.flatnonzero(np.diff(seconds) < 0)
    if block.seam and len(back):
        raise second_record(block.seam, path)
    if len(seconds) < 2 or np.all(np.diff(seconds) > 0):
        _, rate = on_even_grid(seconds, seconds[np.newaxis], fault)
        return Clock(
            used, rate, start, resampled=lambda v: on_even_grid(seconds, v[np.newaxis], fault)[0][0]
        )
    rate = _rate_of_coarse(seconds, stated_hz, fault)
    return Clock(used, rate, start)


def _rate_of_coarse(
    seconds: FloatArray, stated_hz: float, fault: Callable[[int, str], BadInput]
) -> float:
    """Return the rate of times of which several are equal; NaN if only the preamble gives it."""
    steps = np.diff(seconds)
    back = np.flatnonzero(steps < 0)
    if len(back):
        raise fault(int(back[0]) + 1, "the time does not increase")
    moves = np.flatnonzero(steps > 0)
    if len(moves) < 2:
        return NAN
    coarse, span = float(steps[moves].min()), float(seconds[-1] - seconds[0])
    even = np.arange(len(seconds)) * span / (len(seconds) - 1)
    off = seconds - seconds[0] - even
    if off.max() - off.min() > 2.2 * coarse:
        raise fault(int(np.argmax(np.abs(off))), "the times are uneven")
    if coarse / span <= _FINE:
        return (len(seconds) - 1) / span
    # From the first step of the clock to the last there are whole seconds, or whatever it counts.
    inner = (moves[-1] - moves[0]) / (seconds[moves[-1] + 1] - seconds[moves[0] + 1])
    counts = np.diff(moves)
    if not math.isnan(stated_hz):
        return NAN if abs(inner / stated_hz - 1) < 0.02 else float(inner)
    return float(np.rint(inner)) if counts.max() - counts.min() <= 1 else NAN


def _fault(block: DataRows, name: str, path: Path) -> Callable[[int, str], BadInput]:
    return lambda row, what: BadInput(
        f"{what}.", file=path, channel=name, line=block.lines[row], remedy=REMEDY
    )
