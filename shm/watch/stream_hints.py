"""What was noticed of a stream's sensors and logger when a change began leads the alert of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta

from shm.values import Alert
from shm.values.stream import StreamEvent

_HINTS = ("logger", "swapped", "saturated", "drifting", "dead", "clock step")
"""Kinds of events that may be behind frequencies that move, the likeliest first."""
BESIDE = timedelta(hours=3)
"""Judgement: before a change and behind it: who exchanges a sensor works for an hour or two, and
when a change began is known to about as much."""


def led_by(alert: Alert, events: Sequence[StreamEvent]) -> Alert:
    """The alert, led by what was noticed at the time of its change; as it is where nothing was."""
    if alert.change is None:
        return alert
    first, last = alert.change.began_after - BESIDE, alert.change.began_by + BESIDE
    near = [
        event
        for event in events
        if event.kind in _HINTS and event.start <= last and event.end >= first
    ]
    if not near:
        return alert
    event = min(near, key=lambda each: _HINTS.index(each.kind))
    told = f"{event.channel}: {event.detail}" if event.channel else event.detail
    whose = "the logger said" if event.kind == "logger" else f"event '{event.kind}':"
    words = f"check the sensors first, at {event.start:%Y-%m-%d %H:%M} {whose} {told.rstrip('.')}."
    hanger, _, rest = alert.message.partition(": ")
    return replace(alert, message=f"{hanger}: {words} {rest[:1].upper()}{rest[1:]}")
