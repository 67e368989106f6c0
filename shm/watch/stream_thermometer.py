"""Whether a stream's thermometer is believed: by what it says, and by how fast that moves.

A sensor at fault says what no bridge can be. One that came loose or was exchanged jumps, and would
have the watch explain a jump of the tension that never was. It is believed again once it jumps
back, or with a new baseline. While the watch learns, only what is impossible is not believed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from shm.values import COLDEST_C, NAN, WARMEST_C, outdoor_c
from shm.values.stream import StreamEvent, WindowReading

FASTEST_K_PER_H = 57.0
"""Derived: of a rod of 20 mm, the thinnest hanger, that loses nothing of the 900 W/m2 of a high sun
which fall on its diameter d: 4 x 900 / (pi rho c d), with 7850 kg/m3 and 460 J/(kg K)."""
_WINDOW = timedelta(minutes=10)  # the least time over which two values are compared


@dataclass(frozen=True)
class Thermometer:
    """The last value and when that was (seconds of the epoch), and by how much it has jumped: 0
    where it is believed. It was not from `since_s` until `until_s`.
    """

    seen_c: float = NAN
    seen_s: float = -math.inf
    off_k: float = 0.0
    since_s: float = math.inf
    until_s: float = math.inf

    def after(self, value_c: float, at_s: float) -> Thermometer:
        """After one more window's value."""
        if math.isnan(outdoor_c(value_c)) or at_s <= self.seen_s:
            return self
        step = value_c - self.seen_c
        hours = max(at_s - self.seen_s, _WINDOW.total_seconds()) / 3600
        seen = replace(self, seen_c=value_c, seen_s=at_s)
        if abs(self.off_k + step) < abs(self.off_k) / 2:
            return replace(seen, off_k=0.0, until_s=at_s)
        if not abs(step) > FASTEST_K_PER_H * hours:  # NaN at first
            return seen
        since_s = self.since_s if self.off_k else at_s
        return replace(seen, off_k=self.off_k + step, since_s=since_s, until_s=math.inf)

    def learnt(self) -> Thermometer:
        """As it is where what it says from now on is what the watch learns."""
        return Thermometer(self.seen_c, self.seen_s)

    def is_doubted(self, at_s: float) -> bool:
        return self.since_s <= at_s < self.until_s


@dataclass(frozen=True, eq=False)
class Believed:
    """Windows with the temperatures that are believed, NaN else; the thermometer after them."""

    windows: tuple[WindowReading, ...]
    thermometer: Thermometer
    events: tuple[StreamEvent, ...]


def believed(
    thermometer: Thermometer, readings: Sequence[WindowReading], *, learning: bool
) -> Believed:
    """What is believed of the windows' temperatures, after those that came before.

    Windows that the thermometer went through already are judged by what it remembers.
    """
    for each in sorted(readings, key=lambda each: each.window.start):
        thermometer = thermometer.after(each.window.temperature_c, each.window.start.timestamp())
    if learning:
        thermometer = thermometer.learnt()
    found, absurd, doubted = [], [], []
    for each in readings:
        told = each.window.temperature_c
        if math.isfinite(told) and math.isnan(outdoor_c(told)):
            absurd.append(each)
        elif math.isfinite(told) and thermometer.is_doubted(each.window.start.timestamp()):
            doubted.append(each)
        else:
            found.append(each)
            continue
        found.append(replace(each, window=replace(each.window, temperature_c=NAN)))
    events = []
    if absurd:
        events = [_event(absurd, _impossible(absurd[-1].window.temperature_c))]
    elif doubted:
        events = [_event(doubted, _jumped(thermometer, doubted[0].window.start))]
    return Believed(tuple(found), thermometer, tuple(events))


def _impossible(value_c: float) -> str:
    return (
        f"temperature_c is {value_c:g}, and nothing outdoors is below {COLDEST_C:g} or above "
        f"{WARMEST_C:g} °C: the temperature is not known. Check the thermometer, its cable and its "
        "unit, or send none."
    )


def _jumped(thermometer: Thermometer, like: datetime) -> str:
    since = datetime.fromtimestamp(thermometer.since_s, like.tzinfo)
    by = f" by {thermometer.off_k:+.1f} K" if thermometer.off_k else ""
    return (
        f"temperature_c jumped{by} at {since:%Y-%m-%d %H:%M}, faster than steel warms or cools: "
        "the temperature is not known until it jumps back. Check the thermometer; if it is right "
        "now, set a new baseline (`shm drift rebaseline`)."
    )


def _event(of: Sequence[WindowReading], detail: str) -> StreamEvent:
    first, last = of[0].window, of[-1].window
    end = last.start + timedelta(seconds=last.duration_s)
    return StreamEvent(first.stream, "thermometer", first.start, end, detail)
