"""The clock times that loggers write, as text: 2026-05-01T10:00:00.5Z, 01.05.2026 10:00:00,5, ...

A day written 05/01/2026 is the first of May or the fifth of January, and 26/02/03 is one of 2003 or
of 2026. The other days of the file tell which, or another file of its logger; else the time stays
unknown and all possible times are given.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from pathlib import Path
from typing import Literal

import numpy as np

from shm.values import FloatArray

_DAY = r"(?P<a>\d{1,4})(?P<mark>[-./])(?P<b>\d{1,2})[-./](?P<c>\d{1,4})"
_CLOCK = r"(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2}(?:[.,:]\d+)?))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
_ZONE = r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?"
_STAMP = re.compile(
    rf"(?:{_DAY})?(?:\s*[T ,;]\s*|^)(?:{_CLOCK}{_ZONE})|{_DAY.replace('?P<', '?P<d')}"
)
_NAMED_DAYS = (
    "%d-%b-%Y %H:%M:%S", "%d %b %Y %H:%M:%S", "%d. %B %Y %H:%M:%S", "%B %d, %Y %H:%M:%S",
    "%b %d, %Y %H:%M:%S", "%d-%b-%Y", "%d %B %Y", "%B %d, %Y", "%a %b %d %H:%M:%S %Y",
)  # fmt: skip
_DAY_IN_BYTES = re.compile(rb"(?<!\d)\d{1,2}([-/])\d{1,2}\1\d{2}")
_PACKED = (".xlsx", ".xlsm", ".gz")  # whose first bytes tell nothing
_MONTH = re.compile("jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec", re.IGNORECASE)
_DAY_S = 86400.0
_HOUR_S, _WHOLE_S = 3600.0, 1.0
_CLOCK_ONLY = datetime(1, 1, 1, tzinfo=UTC)

DayOrder = Literal["day first", "month first", "year first"]
"""What comes first in a day written as figures, such as 05/01/2026; the month follows a year."""

DAY_ORDERS: tuple[DayOrder, ...] = ("day first", "month first", "year first")


@dataclass(frozen=True)
class PossibleTime:
    """A time as one of the orders in which its day can be read gives it."""

    order: DayOrder
    time: datetime


def is_stamp(text: str) -> bool:
    """Return whether a text is a clock time, a day, or both."""
    return parsed(text) is not None


def parsed(text: str, order: DayOrder | None = None) -> tuple[datetime, bool] | None:
    """Return a time in UTC (taken as such where no zone is said) and whether its day is certain.

    A day that can be read in several orders is read in `order` where that is one of them, else in
    the first of them. A clock time without a day is one of the first of January of the year 1, its
    day not certain.
    """
    found = _STAMP.fullmatch(text.strip())
    if found is None:
        return _named(text.strip())
    try:
        alone = found["da"] is not None
        day, certain = _day(found, "d" if alone else "", order)
        return (day, certain) if alone else (_clocked(day, found), certain)
    except (ValueError, OverflowError):
        return None


def names_zone(text: str) -> bool:
    """Return whether a time says of which zone it is."""
    found = _STAMP.fullmatch(text.strip())
    return found is not None and found["zone"] is not None


def in_zone(time: datetime, zone: tzinfo) -> datetime:
    """Return the time in UTC of a clock in a zone, whose reading was taken for UTC.

    Of the hour that comes twice at the end of summer time, the first.
    """
    return time.replace(tzinfo=zone).astimezone(UTC)


def possible_times(text: str) -> tuple[PossibleTime, ...]:
    """Return the times of a text whose day can be read in several orders.

    Empty where its day is certain, or where it has none.
    """
    found = parsed(text)
    if found is None or found[1] or found[0].year == 1:
        return ()
    each_way = [(order, parsed(text, order)) for order in _orders_of(text)]
    return tuple(PossibleTime(order, each[0]) for order, each in each_way if each is not None)


def order_of_choice(time: datetime, possible: Iterable[PossibleTime]) -> DayOrder | None:
    """Return the only order in which a possible time has the day of `time`, else None."""
    chosen = [each.order for each in possible if each.time.date() == time.date()]
    return chosen[0] if len(chosen) == 1 else None


def find_day_order(texts: Iterable[str]) -> DayOrder | None:
    """Return the order that the days in these texts prove; None where none does, or they differ."""
    proven = {_proven_order(text) for text in texts} - {None}
    return proven.pop() if len(proven) == 1 else None


def _proven_order(text: str) -> DayOrder | None:
    """Return the only order in which a day in figures is one; None of all other texts."""
    orders = _orders_of(text)
    return orders[0] if len(orders) == 1 else None


def _orders_of(text: str) -> tuple[DayOrder, ...]:
    """Return the orders in which a text's day is one; empty where it is always written in one."""
    found = _STAMP.fullmatch(text.strip())
    if found is None or parsed(text) is None:
        return ()
    a, mark, b, c = _parts(found, "" if found["da"] is None else "d")
    return () if a is None or mark == "." or len(a) == 4 else tuple(_days(a, mark, b, c))


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


def _parts(found: re.Match[str], prefix: str) -> tuple[str, str, str, str]:
    a, mark, b, c = (found[f"{prefix}{part}"] for part in ("a", "mark", "b", "c"))
    return a, mark, b, c


def _day(found: re.Match[str], prefix: str, order: DayOrder | None) -> tuple[datetime, bool]:
    a, mark, b, c = _parts(found, prefix)
    if a is None:
        return _CLOCK_ONLY, False
    days = _days(a, mark, b, c)  # AM and PM tell nothing: they do not stay in America
    if not days:
        raise ValueError("no such day")
    if order in days:
        return days[order], True
    return next(iter(days.values())), len(set(days.values())) == 1


def _clocked(day: datetime, found: re.Match[str]) -> datetime:
    hours, minutes = int(found["h"]), int(found["m"])
    seconds = float(re.sub("[,:]", ".", found["s"] or "0"))
    if found["half"]:
        hours = hours % 12 + 12 * found["half"].lower().startswith("p")
    if hours > 23 or minutes > 59 or seconds >= 61:
        raise ValueError("no such time")
    zone = found["zone"] or "Z"
    offset = timedelta()
    if zone[0] in "+-":
        size = timedelta(hours=int(zone[1:3]), minutes=int(zone[-2:]))
        offset = size if zone[0] == "+" else -size
    return day + timedelta(hours=hours, minutes=minutes, seconds=seconds) - offset


def _named(text: str) -> tuple[datetime, bool] | None:
    """Return a time whose month is a word, in English."""
    if _MONTH.search(text) is None:
        return None  # each form below is compiled anew for each text: strptime keeps five
    half = text.upper().endswith(("AM", "PM"))
    plain = re.sub(r"(\d)[.,]\d+( [AP]M)?$", r"\1\2", " ".join(text.split()))
    for form in _NAMED_DAYS:
        form = f"{form} %p".replace("%H", "%I") if half else form
        try:
            return datetime.strptime(plain, form).replace(tzinfo=UTC), True
        except ValueError:
            continue
    return None


def follow_days(texts: Sequence[str]) -> DayOrder | None:
    """Return the order in which stamps that pass midnight follow each other; None where none do."""
    first, last = (
        {each.order: each.time for each in possible_times(text)} for text in (texts[0], texts[-1])
    )
    spans = {order: abs(last[order] - first[order]) for order in first.keys() & last.keys()}
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


def seconds_of_stamps(texts: Sequence[str], order: DayOrder | None = None) -> FloatArray | None:
    """Return seconds since the first of the stamps, midnights passed; None where one is no stamp.

    Days that can be read in several orders are read in `order`.
    """
    first = parsed(texts[0], order) if texts else None
    if first is None:
        return None
    seconds, days = np.empty(len(texts)), 0.0
    for place, text in enumerate(texts):
        found = parsed(text, order)
        if found is None:
            return None
        seconds[place] = (found[0] - first[0]).total_seconds() + days
        if place and found[0].year == 1 and seconds[place] < seconds[place - 1] - _DAY_S / 2:
            days += _DAY_S
            seconds[place] += _DAY_S
    return seconds


def moment(day: str, clock: str, order: DayOrder | None = None) -> datetime | None:
    """Return the time of a day and a clock time, of which either may hold both; None if unsure.

    A day that can be read in several orders is read in `order`.
    """
    for text in (f"{day} {clock}".strip(), day, clock):
        found = parsed(text, order) if text else None
        if found is not None and found[1]:
            return found[0] if found[0].year > 1 else None
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
