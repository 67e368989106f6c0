"""The clock times that loggers write, as text: 2026-05-01T10:00:00.5Z, 01.05.2026 10:00:00,5, ...

A day written 05/01/2026 is the first of May or the fifth of January. What happens within a record
does not depend on it; where nothing tells, the time of the test stays unknown.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

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
_MONTH = re.compile("jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec", re.IGNORECASE)
_DAY_S = 86400.0
_CLOCK_ONLY = datetime(1, 1, 1, tzinfo=UTC)


def is_stamp(text: str) -> bool:
    """Whether a text is a clock time, a day, or both."""
    return parsed(text) is not None


def parsed(text: str) -> tuple[datetime, bool] | None:
    """A time in UTC (taken as such where no zone is said) and whether its day is certain.

    A clock time without a day is one of the first of January of the year 1, its day not certain.
    """
    found = _STAMP.fullmatch(text.strip())
    if found is None:
        return _named(text.strip())
    try:
        alone = found["da"] is not None
        day, certain = _day(found, "d" if alone else "")
        return (day, certain) if alone else (_clocked(day, found), certain)
    except (ValueError, OverflowError):
        return None


def _day(found: re.Match[str], prefix: str) -> tuple[datetime, bool]:
    a, mark, b, c = (found[f"{prefix}{part}"] for part in ("a", "mark", "b", "c"))
    if a is None:
        return _CLOCK_ONLY, False
    first, second, third = int(a), int(b), int(c)
    if len(a) == 4:
        return datetime(first, second, third, tzinfo=UTC), True
    year = third + 2000 if third < 100 else third
    is_american = mark == "/" and second > 12  # AM and PM say nothing: they do not stay in America
    day, month = (second, first) if is_american else (first, second)
    certain = mark == "." or is_american or first > 12 or first == second
    return datetime(year, month, day, tzinfo=UTC), certain


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
    """A time whose month is a word, in English."""
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


def seconds_of_stamps(texts: Sequence[str]) -> FloatArray | None:
    """Seconds since the first of the stamps, midnights passed; None where one is no stamp."""
    first = parsed(texts[0]) if texts else None
    if first is None:
        return None
    seconds, days = np.empty(len(texts)), 0.0
    for place, text in enumerate(texts):
        found = parsed(text)
        if found is None:
            return None
        seconds[place] = (found[0] - first[0]).total_seconds() + days
        if place and found[0].year == 1 and seconds[place] < seconds[place - 1] - _DAY_S / 2:
            days += _DAY_S
            seconds[place] += _DAY_S
    return seconds


def moment(day: str, clock: str) -> datetime | None:
    """The time that a day and a clock time say, of which either may hold both; None if unsure."""
    for text in (f"{day} {clock}".strip(), day, clock):
        found = parsed(text) if text else None
        if found is not None and found[1]:
            return found[0] if found[0].year > 1 else None
    return None
