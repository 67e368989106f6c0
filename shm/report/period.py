"""The period that a report looks at: since when, what lies in it, how one writes it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from shm.errors import UsageError

_SPAN = re.compile(r"(\d{1,5})\s*([dwmy])", re.IGNORECASE)
_DAYS = {"d": 1.0, "w": 7.0, "m": 365.25 / 12, "y": 365.25}  # a Julian year and its twelfth
_REMEDY = "Give a date such as 2026-03-01, or a span such as 90d, 12w, 6m or 1y."


@dataclass(frozen=True)
class Period:
    """From `since` on, up to the moment `until` at which the report is made; both are aware."""

    since: datetime
    until: datetime

    def holds(self, time: datetime | None) -> bool:
        """Whether `time` lies in it, or ahead of it by another clock; an unknown one does not."""
        return time is not None and time >= self.since

    def __str__(self) -> str:
        """`2026-03-01 to 2026-05-25`."""
        return f"{_day(self.since)} to {_day(self.until)}"


def period_since(told: str, now: datetime) -> Period:
    """The period that a person writes: `2026-03-01`, `2026-03-01T10:00`, `90d`, `12w`, `6m`, `1y`.

    A date is taken in UTC, a month as the twelfth of a year. Raises UsageError where it is neither,
    or lies ahead of `now`.
    """
    since = _since(told.strip(), now)
    if since >= now:
        raise UsageError(f"a period since {_day(since)} has not begun yet.", remedy=_REMEDY)
    return Period(since, now)


def period_json(period: Period | None) -> dict[str, datetime] | None:
    """The period in a JSON document."""
    return {"since": period.since, "until": period.until} if period else None


def _since(told: str, now: datetime) -> datetime:
    try:
        if found := _SPAN.fullmatch(told):
            return now - timedelta(days=int(found[1]) * _DAYS[found[2].lower()])
        since = datetime.fromisoformat(told)
    except (ValueError, OverflowError):
        raise UsageError(
            f"{told!r} is neither a date nor a span of time.", remedy=_REMEDY
        ) from None
    return since.replace(tzinfo=UTC) if since.tzinfo is None else since


def _day(time: datetime) -> str:
    return f"{time.astimezone(UTC):%Y-%m-%d}"
