"""Which permanent sensors say nothing: what `shm doctor`, the pages and the messages tell alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Literal

from shm.store import Store, Workspace
from shm.values.messages import WEEK, Lead
from shm.values.rounding import listed
from shm.values.stream import Stream, StreamEvent

State = Literal[
    "live", "late", "silent", "never sent", "sensor at fault", "sees nothing", "clock ahead"
]

REMEDIES: dict[State, str] = {
    "never sent": "Connect the logger: docs/permanent_sensors.md.",
    "silent": "Look at logger, power and connection; what was stored comes once they are back.",
    "sees nothing": "See whether the sensors are fixed to the hanger and connected to the logger.",
    "clock ahead": "Set the logger's clock, to UTC: by its stamps none can tell whether it sends.",
    "sensor at fault": "See `shm stream --events`, and the page of the stream on the dashboard.",
}
"""Of each state that a person should know of."""

LATELY = timedelta(days=1)
_LATE, _SILENT = timedelta(minutes=5), timedelta(hours=1)
"""judgement: loggers send each minute; a router begins anew within five minutes."""
_AHEAD = timedelta(minutes=2)  # judgement: clocks without GPS or NTP are seconds off
_AT_FAULT = ("dead", "drifting", "swapped", "saturated", "thermometer")
_FAULT_STANDS = timedelta(hours=1)  # six windows: one that shows nothing ends it
_STANDS = {"thermometer": timedelta(hours=2)}  # derived: an hour is judged once it is over
_NAMED = 5  # of many: the page of sensors lists them all
_BLIND: dict[State, tuple[str, str]] = {
    "silent": ("silent", f"Look at its logger, power and connection {WEEK}."),
    "sees nothing": (
        "without any motion of it",
        f"See {WEEK} whether the sensors are fixed to it and connected.",
    ),
}


@dataclass(frozen=True)
class Heard:
    """A stream and how it is, by its last sample."""

    stream: Stream
    state: State
    last_sample: datetime | None

    @property
    def named(self) -> str:
        last = self.last_sample
        since = f" (last sample {last:%Y-%m-%d %H:%M} UTC)" if last else ""
        return f"{self.stream.name}{since}"


def heard(workspace: Workspace, store: Store, now: datetime) -> tuple[Heard, ...]:
    """Each stream that `bridge.toml` describes, in its order."""
    if not workspace.bridge.streams:
        return ()
    # It brings h5py, and most bridges have no streams.
    from shm.store.ring import ring_of

    latest = ring_of(workspace).latest()
    return tuple(
        Heard(each, word_of(last, store.streams.list_events(each.name, now - LATELY), now), last)
        for each in workspace.bridge.streams
        for last in [latest.get(each.name)]
    )


def word_of(last: datetime | None, events: Sequence[StreamEvent], now: datetime) -> State:
    """How a stream is by its last sample and the `events` of a day."""
    if last is None:
        return "never sent"
    if last - now > _AHEAD:  # whether it still sends cannot be told by its stamps
        return "clock ahead"
    if now - last > _SILENT:
        return "silent"
    if now - last > _LATE:
        return "late"
    standing = {
        each.kind for each in events if last - each.end < _STANDS.get(each.kind, _FAULT_STANDS)
    }
    if "lost modes" in standing:
        return "sees nothing"
    return "live" if standing.isdisjoint(_AT_FAULT) else "sensor at fault"


def leads_of(found: Sequence[Heard]) -> tuple[Lead, ...]:
    """Of each state that somebody should know of, the streams that are in it, and the remedy."""
    leads = []
    for state, remedy in REMEDIES.items():
        own = [each.named for each in found if each.state == state]
        if own:
            more = ["others"] if own[_NAMED:] else []
            what = "Streams" if own[1:] else "Stream"
            leads.append(Lead(f"{what} {listed([*own[:_NAMED], *more])}: {state}.", remedy))
    return tuple(leads)


def blind_hangers(found: Sequence[Heard]) -> dict[int, Lead]:
    """What is said first of each hanger whose stream says nothing."""
    leads = {}
    for each in found:
        if each.state in _BLIND:
            what, action = _BLIND[each.state]
            hanger = each.stream.hanger
            leads[hanger] = Lead(f"Hanger {hanger}: its stream {each.named} is {what}.", action)
    return leads
