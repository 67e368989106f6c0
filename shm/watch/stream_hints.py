"""What was noticed of a stream's sensors and logger when a change began leads the alert of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta

from shm.values import Alert, Change
from shm.values.stream import StreamEvent

_HINTS = ("logger", "swapped", "saturated", "drifting", "dead", "clock step")
"""Kinds of events that may be behind frequencies that move, the likeliest first."""
BESIDE = timedelta(hours=3)
"""Judgement: before a change and behind it: who exchanges a sensor works for an hour or two, and
when a change began is known to about as much."""
_LATELY = timedelta(hours=1)  # the hour of the alert itself


def led_by(alert: Alert, events: Sequence[StreamEvent]) -> Alert:
    """The alert, led by what was noticed at the time of its change, and by that its temperature is
    not known; as it is where nothing was.
    """
    if alert.change is None:
        return alert
    words = " ".join(filter(None, (_near(alert.change, events), _unknown(alert, events))))
    if not words:
        return alert
    hanger, _, rest = alert.message.partition(": ")
    return replace(alert, message=f"{hanger}: {words} {rest[:1].upper()}{rest[1:]}")


def _near(change: Change, events: Sequence[StreamEvent]) -> str:
    first, last = change.began_after - BESIDE, change.began_by + BESIDE
    near = [
        event
        for event in events
        if event.kind in _HINTS and event.start <= last and event.end >= first
    ]
    if not near:
        return ""
    event = min(near, key=lambda each: _HINTS.index(each.kind))
    told = f"{event.channel}: {event.detail}" if event.channel else event.detail
    whose = "the logger said" if event.kind == "logger" else f"event '{event.kind}':"
    return f"check the sensors first, at {event.start:%Y-%m-%d %H:%M} {whose} {told.rstrip('.')}."


def _unknown(alert: Alert, events: Sequence[StreamEvent]) -> str:
    told = [e for e in events if e.kind == "thermometer" and e.end > alert.time - _LATELY]
    if not told:
        return ""
    why = told[-1].detail.partition(": ")[0]
    return f"the temperature is not known ({why}): part of this may be the weather's."
