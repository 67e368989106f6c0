"""The quiet hours of a hook: from when to when it is told only of what is urgent."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta, tzinfo
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from shm.bridge.table import Table
from shm.errors import BadInput

QUIET_HOURS = "quiet_hours"
_TIME = r"((?:[01][0-9]|2[0-3]):[0-5][0-9])"
_SPAN = re.compile(f"{_TIME}-{_TIME}")


@dataclass(frozen=True)
class QuietHours:
    """Each day's span, over midnight where it ends no later than it begins, by the clocks there.

    A time that the change to summer time leaves out, or that comes twice in autumn, is read as
    calendars read it (RFC 5545, 3.3.5): by the clock before the gap, and as the first of the two.
    """

    begins: time
    ends: time
    zone: tzinfo

    def __str__(self) -> str:
        return f"{self.begins:%H:%M}-{self.ends:%H:%M}"

    def until(self, at: datetime) -> datetime | None:
        """When the hours end that a moment lies in, by the clocks there; None where in none."""
        today = at.astimezone(self.zone).date()
        for day in (today - timedelta(days=1), today):
            last_day = day if self.begins < self.ends else day + timedelta(days=1)
            # In UTC: times of one zone are compared by their clock faces, even where clocks change.
            begins = datetime.combine(day, self.begins, self.zone).astimezone(UTC)
            ends = datetime.combine(last_day, self.ends, self.zone).astimezone(UTC)
            if begins <= at < ends:
                return ends.astimezone(self.zone)
        return None


def quiet_hours_of(table: Table, zone: tzinfo) -> QuietHours | None:
    """Those of a `[[hook]]` table, None where it states none; raises BadInput."""
    if QUIET_HOURS not in table:
        return None
    text = table.values[QUIET_HOURS]
    found = _SPAN.fullmatch(text) if isinstance(text, str) else None
    if found is None or found[1] == found[2]:
        raise table.refusal(
            f"{QUIET_HOURS} = {text!r} is not a span of the day",
            f'Give two different times: {QUIET_HOURS} = "22:00-06:00".',
        )
    begins, ends = map(time.fromisoformat, found.groups())
    return QuietHours(begins, ends, zone)


def zone_of(values: dict[str, Any], path: Path) -> tzinfo:
    """The time zone that `[bridge]` states, else UTC; raises BadInput for one that nobody knows."""
    name = values.get("time_zone", "UTC")
    if name == "UTC":
        return UTC  # known where the computer has no table of zones, too
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, TypeError, OSError):
        raise BadInput(
            f"bridge: time_zone = {name!r} is no time zone that this computer knows.",
            file=path,
            remedy='Write time_zone = "Europe/Berlin", or leave it out for UTC.',
        ) from None
