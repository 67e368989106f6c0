"""The clock times that loggers write, as text: 2026-05-01T10:00:00.5Z, 01.05.2026 10:00:00,5, ...

A day written 05/01/2026 is the first of May or the fifth of January, and 26/02/03 is one of 2003 or
of 2026. The other days of the file tell which, or another file of its logger; else the time stays
unknown and all possible times are given.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from shm.values import FloatArray

_DAY = r"(?P<a>\d{1,4})(?P<mark>[-./])(?P<b>\d{1,2})[-./](?P<c>\d{1,4})"
_CLOCK = r"(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2}(?:[.,:]\d+)?))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
_ZONE = r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?"
_STAMP = re.compile(rf"(?:{_DAY})?(?:(?:\s*[T ,;]\s*|^){_CLOCK}{_ZONE})?")
_NAMED_DAYS = (
    "%d-%b-%Y", "%d-%b-%y", "%d %b %Y", "%d. %B %Y", "%d %B %Y", "%B %d, %Y", "%b %d, %Y",
    "%a %b %d %Y",
)  # fmt: skip
_NAMED = re.compile(r"(jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)", re.IGNORECASE)
_DAY_IN_BYTES = re.compile(rb"(?<!\d)\d{1,2}([-/])\d{1,2}\1\d{2}")
_PACKED = (".xlsx", ".xlsm", ".gz")  # whose first bytes tell nothing
_DAY_S = 86400.0
_HOUR_S, _WHOLE_S = 3600.0, 1.0
_NO_DAY = datetime(1, 1, 1, tzinfo=UTC)

DayOrder = Literal["day first", "month first", "year first"]
"""What comes first in a day written as figures, such as 05/01/2026; the month follows a year."""

DAY_ORDERS: tuple[DayOrder, ...] = ("day first", "month first", "year first")


@dataclass(frozen=True)
class PossibleTime:
    """A time as one of the orders in which its day can be read gives it."""

    order: DayOrder
    time: datetime


@dataclass(frozen=True)
class Stamp:
    """A time as written, in UTC where it names no zone: `days` are those that it may be of.

    A clock time without a day has none. `is_ordered` says that the days are read by their order.
    """

    days: Mapping[DayOrder, datetime]
    is_ordered: bool
    clock: timedelta
    has_zone: bool

    def time(self, order: DayOrder | None = None) -> datetime:
        """Return the time, of a day in `order` where that is one of it, else in the first.

        Without a day it is one of the first of January of the year 1.
        """
        day = self.days.get(order) if order else None
        return (day or next(iter(self.days.values()), _NO_DAY)) + self.clock

    def is_certain(self, order: DayOrder | None = None) -> bool:
        """Return whether the day is known, with the order of the file's days."""
        return order in self.days or len(set(self.days.values())) == 1


@lru_cache(maxsize=1000)
def stamp_of(text: str) -> Stamp | None:
    """Return the clock time, the day, or both, that a text is; None for any other text."""
    text = text.strip()
    found = _STAMP.fullmatch(text)
    if found is None or not text:
        return _of_named_month(text) if _NAMED.search(text) else None
    a, mark, b, c = (found[part] for part in ("a", "mark", "b", "c"))
    days = {} if a is None else _days(a, mark, b, c)
    clock = _clock(found) if found["h"] else timedelta()
    if clock is None or (a is not None and not days):
        return None
    is_ordered = a is not None and mark != "." and len(a) != 4
    return Stamp(days, is_ordered, clock, found["zone"] is not None)


def _days(a: str, mark: str, b: str, c: str) -> dict[DayOrder, datetime]:
    """Return the days that three figures can be, by the order in which they are written."""
    day_first, month_first, year_first = DAY_ORDERS
    if len(a) == 4:
        ways = {year_first: (a, b, c)}
    elif mark == ".":
        ways = {day_first: (c, b, a)}
    else:
        ways = {day_first: (c, b, a), month_first: (c, a, b), year_first: (a, b, c)}
    days = {}
    for order, (year, month, day) in ways.items():
        if len(year) not in (2, 4) or len(day) > 2:
            continue
        number = int(year) + 2000 if len(year) == 2 else int(year)
        with suppress(ValueError):  # no day of the calendar
            days[order] = datetime(number, int(month), int(day), tzinfo=UTC)
    return days


def _clock(found: re.Match[str]) -> timedelta | None:
    """Return the time since midnight in UTC; None where there is no such time."""
    hours, minutes = int(found["h"]), int(found["m"])
    seconds = float(re.sub("[,:]", ".", found["s"] or "0"))
    if found["half"]:  # it tells nothing of the day: AM and PM do not stay in America
        hours = hours % 12 + 12 * found["half"].lower().startswith("p")
    if hours > 23 or minutes > 59 or seconds >= 61:
        return None
    zone, offset = found.groupdict().get("zone") or "Z", timedelta()
    if zone[0] in "+-":
        offset = timedelta(hours=int(zone[1:3]), minutes=int(zone[-2:])) * int(f"{zone[0]}1")
    return timedelta(hours=hours, minutes=minutes, seconds=seconds) - offset


def _of_named_month(text: str) -> Stamp | None:
    """Return a time whose month is a word, in English."""
    found = re.search(_CLOCK, text)
    clock = timedelta() if found is None else _clock(found)
    if clock is None:
        return None
    day = text if found is None else text[: found.start()] + text[found.end() :]
    for form in _NAMED_DAYS:
        with suppress(ValueError):
            of_day = datetime.strptime(" ".join(day.split()), form).replace(tzinfo=UTC)
            return Stamp({"day first": of_day}, False, clock, False)
    return None


def is_stamp(text: str) -> bool:
    """Return whether a text is a clock time, a day, or both."""
    return stamp_of(text) is not None


def names_zone(text: str) -> bool:
    """Return whether a time says of which zone it is."""
    found = stamp_of(text)
    return found is not None and found.has_zone


def in_zone(time: datetime, zone: tzinfo) -> datetime:
    """Return the time in UTC of a clock in a zone, whose reading was taken for UTC.

    Of the hour that comes twice at the end of summer time, the first.
    """
    return time.replace(tzinfo=zone).astimezone(UTC)


def possible_times(text: str) -> tuple[PossibleTime, ...]:
    """Return the times of a text whose day can be read in several orders.

    Empty where its day is certain, or where it has none.
    """
    found = stamp_of(text)
    if found is None or found.is_certain():
        return ()
    return tuple(PossibleTime(order, found.time(order)) for order in found.days)


def order_of_choice(time: datetime, possible: Iterable[PossibleTime]) -> DayOrder | None:
    """Return the only order in which a possible time has the day of `time`, else None."""
    chosen = [each.order for each in possible if each.time.date() == time.date()]
    return chosen[0] if len(chosen) == 1 else None


def find_day_order(texts: Iterable[str]) -> DayOrder | None:
    """Return the order that the days in these texts prove; None where none does, or they differ."""
    ordered = [found for text in texts if (found := stamp_of(text)) and found.is_ordered]
    proven = {next(iter(found.days)) for found in ordered if len(found.days) == 1}
    return proven.pop() if len(proven) == 1 else None


def follow_days(first: str, last: str) -> DayOrder | None:
    """Return the order in which two stamps follow each other soonest; None where none does alone.

    Rows that pass midnight lie a month apart in all other orders.
    """
    ends = stamp_of(first), stamp_of(last)
    days = [end.days if end is not None and end.is_ordered else {} for end in ends]
    spans = {order: abs(days[1][order] - days[0][order]) for order in days[0].keys() & days[1]}
    least = [order for order in spans if spans[order] == min(spans.values())]
    return least[0] if len(least) == 1 < len(spans) else None


def may_hold_days(path: Path, head_bytes: int = 20_000) -> bool:
    """Return whether the first bytes of a file hold days such as 05/01/2026, or it is packed."""
    if path.suffix.lower() in _PACKED:
        return True
    try:
        with path.open("rb") as file:
            head = file.read(head_bytes)
    except OSError:
        return False  # it is refused with its reason where it is read
    return bool(_DAY_IN_BYTES.search(head.replace(b"\0", b"")))


def seconds_of_stamps(texts: Sequence[str], order: DayOrder | None = None) -> FloatArray:
    """Return seconds since the first of the stamps, midnights passed; NaN where one is no stamp.

    Days that can be read in several orders are read in `order`.
    """
    seconds, days = np.full(len(texts), np.nan), 0.0
    first, before = None, -np.inf
    for place, text in enumerate(texts):
        found = stamp_of(text)
        if found is None:
            continue
        first = first or found.time(order)
        seconds[place] = (found.time(order) - first).total_seconds() + days
        if not found.days and seconds[place] < before - _DAY_S / 2:
            days += _DAY_S
            seconds[place] += _DAY_S
        before = seconds[place]
    return seconds


def moment(day: str, clock: str, order: DayOrder | None = None) -> datetime | None:
    """Return the time of a day and a clock time, of which either may hold both; None if unsure.

    A day that can be read in several orders is read in `order`.
    """
    for text in (f"{day} {clock}".strip(), day, clock):
        found = stamp_of(text) if text else None
        if found is not None and found.is_certain(order):
            return found.time(order)
    return None


def without_clock_change(seconds: FloatArray) -> tuple[FloatArray, int | None]:
    """Return times that run on over the end of summer time, and the place where the hour came back.

    Nothing but a clock set back makes times fall by an hour less one step. None where none does.
    """
    steps = np.diff(seconds)
    back = np.flatnonzero(steps < 0)
    step = float(np.median(steps)) if len(steps) else 0.0
    if len(back) != 1 or abs(steps[back[0]] + _HOUR_S - step) > max(step, _WHOLE_S):
        return seconds, None
    place = int(back[0]) + 1
    later = np.arange(len(seconds)) >= place
    return seconds + _HOUR_S * later, place
