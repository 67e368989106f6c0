"""Judge a stream's thermometer by its values and how they move.

One that jumps is believed again once it jumps back, or with a new baseline; one that stands still,
once it moves. While the watch learns, only what is impossible is not believed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from shm.values import COLDEST_C, NAN, WARMEST_C, outdoor_c
from shm.values.stream import StreamEvent, Window, WindowReading
from shm.watch.engine.limits import LIMITS

_WINDOW = timedelta(minutes=10)  # the least time over which two values are compared


@dataclass(frozen=True)
class Thermometer:
    """The last value and when that was (seconds of the epoch), and by how much it has jumped: 0
    where it is believed. It was not from `since_s` until `until_s`. Since `still_s` it said the
    same so many times more (`still`).
    """

    seen_c: float = NAN
    seen_s: float = -math.inf
    off_k: float = 0.0
    since_s: float = math.inf
    until_s: float = math.inf
    still_s: float = math.inf
    still: int = 0

    def after(self, value_c: float, at_s: float) -> Thermometer:
        """After one more window's value."""
        if math.isnan(outdoor_c(value_c)) or at_s <= self.seen_s:
            return self
        step = value_c - self.seen_c
        hours = max(at_s - self.seen_s, _WINDOW.total_seconds()) / 3600
        if abs(step) < LIMITS.still_k:  # compared with the first of them, or a creep would be none
            seen = replace(self, seen_s=at_s, still=self.still + 1)
            is_stuck = at_s - self.still_s >= LIMITS.still_s and seen.still >= LIMITS.still_windows
            if self.is_doubted(at_s) or not is_stuck:
                return seen
            return replace(seen, since_s=at_s, until_s=math.inf)
        seen = replace(self, seen_c=value_c, seen_s=at_s, still_s=at_s, still=0)
        if self.is_doubted(at_s) and not self.off_k:  # it was stuck
            return replace(seen, until_s=at_s)
        if abs(self.off_k + step) < abs(self.off_k) / 2:
            return replace(seen, off_k=0.0, until_s=at_s)
        if not abs(step) > LIMITS.fastest_k_per_h * hours:  # NaN at first
            return seen
        since_s = self.since_s if self.off_k else at_s
        return replace(seen, off_k=self.off_k + step, since_s=since_s, until_s=math.inf)

    def learnt(self) -> Thermometer:
        """As it is where what it says from now on is what the watch learns."""
        return Thermometer(self.seen_c, self.seen_s, still_s=self.still_s, still=self.still)

    def is_doubted(self, at_s: float) -> bool:
        return self.since_s <= at_s < self.until_s

    def why_doubted(self, first: Window) -> str:
        """Return why the temperature of a window, and of those after it, is not believed."""
        is_stuck = self.since_s - self.still_s >= LIMITS.still_s
        began_s = self.still_s if is_stuck else self.since_s
        since = f"{datetime.fromtimestamp(began_s, first.start.tzinfo):%Y-%m-%d %H:%M}"
        if is_stuck:
            return (
                f"temperature_c has been {first.temperature_c:g} since {since}, and no day is as "
                "even: the temperature is not known until it moves. Check the thermometer."
            )
        by = f" by {self.off_k:+.1f} K" if self.off_k else ""
        return (
            f"temperature_c jumped{by} at {since}, faster than steel warms or cools: the "
            "temperature is not known until it jumps back. Check the thermometer; if it is right "
            "now, set a new baseline (`shm drift rebaseline`)."
        )


@dataclass(frozen=True, eq=False)
class Believed:
    """Windows with the temperatures that are believed, NaN else; the thermometer after them."""

    windows: tuple[WindowReading, ...]
    thermometer: Thermometer
    events: tuple[StreamEvent, ...]


def believed(
    thermometer: Thermometer, readings: Sequence[WindowReading], *, learning: bool
) -> Believed:
    """Return what is believed of the windows' temperatures, after those that came before.

    Windows that the thermometer went through already are judged by what it remembers.
    """
    for each in sorted(readings, key=lambda each: each.window.start):
        thermometer = thermometer.after(each.window.temperature_c, each.window.start.timestamp())
    if learning:
        thermometer = thermometer.learnt()
    found: list[WindowReading] = []
    absurd: list[Window] = []
    doubted: list[Window] = []
    for each in readings:
        window, reported = each.window, each.window.temperature_c
        if math.isfinite(reported):
            is_absurd = math.isnan(outdoor_c(reported))
            if is_absurd or thermometer.is_doubted(window.start.timestamp()):
                (absurd if is_absurd else doubted).append(window)
                each = replace(each, window=replace(window, temperature_c=NAN))
        found.append(each)
    events: tuple[StreamEvent, ...] = ()
    if wrong := absurd or doubted:
        last, why = wrong[-1], _impossible if absurd else thermometer.why_doubted
        end = last.start + timedelta(seconds=last.duration_s)
        detail = why(last if absurd else wrong[0])
        events = (StreamEvent(last.stream, "thermometer", wrong[0].start, end, detail),)
    return Believed(tuple(found), thermometer, events)


def _impossible(window: Window) -> str:
    return (
        f"temperature_c is {window.temperature_c:g}, and nothing outdoors is below {COLDEST_C:g} "
        f"or above {WARMEST_C:g} °C: the temperature is not known. Check the thermometer, its "
        "cable and its unit, or send none."
    )
