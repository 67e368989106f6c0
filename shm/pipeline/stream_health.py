"""Find permanent sensors that are silent or disagree with the others.

What `shm doctor`, the pages and the messages tell alike. An event of each stream that begins to see
nothing, an alert of what lasts for a day, over once it ends; thermometers against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal

from shm.pipeline.reconcile import Condition, reconcile
from shm.store import Store, Workspace
from shm.store.ring import Ring, ring_of
from shm.store.streams import (
    find_progress,
    list_latest_with_modes,
    list_stream_events,
    list_window_starts,
    list_windows,
)
from shm.values import Alert, AlertKind
from shm.values.messages import WEEK, Lead
from shm.values.rounding import listed
from shm.values.stream import PERIOD, Stream, StreamEvent

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
_AT_FAULT = ("dead", "drifting", "swapped", "saturated", "lost modes", "thermometer")
_FAULT_LASTS = timedelta(hours=1)  # six windows: one that shows nothing ends it
_LASTS = {"thermometer": timedelta(hours=2)}  # derived: an hour is judged once it is over
_NAMED = 5  # of many: the page of sensors lists them all


_UNSEEN: dict[State, tuple[str, str]] = {
    "silent": ("silent", f"Look at its logger, power and connection {WEEK}."),
    "sees nothing": (
        "without any motion of it",
        f"See {WEEK} whether the sensors are fixed to it and connected.",
    ),
}
"""States in which nobody sees a hanger: what is said of it, and what to do."""


@dataclass(frozen=True)
class StreamHealth:
    """State of a stream.

    `last_sample` is when its last sample was taken, `heard_at` when it was last heard of, by that
    sample or by whatever came later: a backlog is old, and no silence. `unread` is how much the
    watch has not read, `events` are those of the last day.
    """

    stream: Stream
    state: State
    last_sample: datetime | None
    heard_at: datetime | None = None
    unread: timedelta = timedelta(0)
    events: tuple[StreamEvent, ...] = ()

    @property
    def named(self) -> str:
        last = self.last_sample
        since = f" (last sample {last:%Y-%m-%d %H:%M} UTC)" if last else ""
        return f"{self.stream.name}{since}"


def heard(workspace: Workspace, store: Store, now: datetime) -> tuple[StreamHealth, ...]:
    """Return the state of each stream that `bridge.toml` describes, in its order.

    Where the ring is empty, after a restore or a long silence, the end of the last window counts.
    """
    if not workspace.bridge.streams:
        return ()
    ring = ring_of(workspace)
    latest, arrivals = ring.latest(), ring.last_arrivals()
    found = []
    for stream in workspace.bridge.streams:
        last = latest.get(stream.name) or find_progress(store, stream.name)
        # An arrival that is yet to come was noted by a clock that was ahead.
        times = [at for at in (last, arrivals.get(stream.name)) if at and at - now <= _AHEAD]
        heard_at = max(times, default=last)
        events = list_stream_events(store, stream.name, now - LATELY)
        state = classify_stream(last, heard_at, events, now)
        unread = measure_unread(workspace, ring, store, stream.name, now)
        found.append(StreamHealth(stream, state, last, heard_at, unread, events))
    return tuple(found)


def classify_stream(
    last: datetime | None, heard_at: datetime | None, events: Sequence[StreamEvent], now: datetime
) -> State:
    """Return how a stream is by its last sample, when it was heard of, and a day's `events`."""
    if last is None or heard_at is None:
        return "never sent"
    if last - now > _AHEAD:  # whether it still sends cannot be told by its stamps
        return "clock ahead"
    if now - heard_at > _SILENT:
        return "silent"
    if now - last > _LATE:
        return "late"
    standing = [e for e in events if last - e.end < _LASTS.get(e.kind, _FAULT_LASTS)]
    if any(each.kind == "lost modes" and not each.channel for each in standing):
        return "sees nothing"
    return "sensor at fault" if any(each.kind in _AT_FAULT for each in standing) else "live"


def stream_leads(found: Sequence[StreamHealth]) -> tuple[Lead, ...]:
    """Return what somebody should know of the streams."""
    return (*leads_of(found), *backlog_leads(found))


def backlog_leads(
    found: Sequence[StreamHealth], longest: timedelta = timedelta(hours=1)
) -> tuple[Lead, ...]:
    """Return what to say of streams of which more than `longest` is not read yet."""
    behind = [each for each in found if each.unread > longest]
    names = [
        f"{each.stream.name} ({each.unread / timedelta(hours=1):.3g} hours)" for each in behind
    ]
    state = f"{_listed(names)}: samples are not read yet, so the watch is behind."
    action = (
        "Start `shm daemon` if none is active; if one is, give it more processors and raise the "
        "setting workers."
    )
    return (Lead(state, action),) if names else ()


def leads_of(found: Sequence[StreamHealth]) -> tuple[Lead, ...]:
    """Return for each state that somebody should know of the streams in it, and the remedy."""
    named = {state: [e.named for e in found if e.state == state] for state in REMEDIES}
    return tuple(
        Lead(f"{_listed(names)}: {state}.", REMEDIES[state])
        for state, names in named.items()
        if names
    )


def _listed(names: Sequence[str]) -> str:
    more = ["others"] if names[_NAMED:] else []
    return f"{'Streams' if names[1:] else 'Stream'} {listed([*names[:_NAMED], *more])}"


def lateness_limit(workspace: Workspace, now: datetime) -> datetime:
    """Return the time of the oldest samples that may still come late and are read then."""
    settings = workspace.settings
    return now - timedelta(hours=min(settings.late_hours, 24 * settings.window_days))


def list_unread(
    workspace: Workspace, ring: Ring, store: Store, stream: str, now: datetime
) -> tuple[datetime, ...]:
    """Return when the sealed ten minutes of a stream begin that the watch has not read."""
    done, since = find_progress(store, stream), lateness_limit(workspace, now)
    begin = datetime.min.replace(tzinfo=UTC) if done is None else min(done, since)
    periods = ring.periods(stream, begin)
    if not periods:
        return ()
    read = list_window_starts(store, stream, periods[0])
    return tuple(start for start in periods if start not in read)


def measure_unread(
    workspace: Workspace, ring: Ring, store: Store, stream: str, now: datetime
) -> timedelta:
    """Return the length of all ten minutes with samples that the watch has not read."""
    unread = set(list_unread(workspace, ring, store, stream, now))
    return len(unread | ring.unsealed_periods(stream)) * PERIOD


def sweep_ring(workspace: Workspace, ring: Ring, store: Store, now: datetime) -> None:
    """Remove old samples from the ring, but none that the watch has yet to read."""
    settings = workspace.settings
    names = [stream.name for stream in workspace.bridge.streams]
    unread = {name: list_unread(workspace, ring, store, name, now) for name in names}
    ring.sweep(now, settings.ring_days, settings.ring_bytes, unread)


def blind_hangers(found: Sequence[StreamHealth]) -> dict[int, Lead]:
    """Return what is said first of each hanger whose stream says nothing."""
    return {each.stream.hanger: _lead(each) for each in found if each.state in _UNSEEN}


def _lead(health: StreamHealth) -> Lead:
    what, action = _UNSEEN[health.state]
    return Lead(f"Hanger {health.stream.hanger}: its stream {health.named} is {what}.", action)


_KIND: AlertKind = "silent"
_LONG = timedelta(hours=26)
"""judgement: what a logger begins anew by itself, or sends as one file a day, needs nobody."""


def evaluate_silent_streams(workspace: Workspace, store: Store, at: datetime) -> None:
    """Open an alert of each stream that has not seen its hanger for a day; close what is over."""
    is_open = [each for each in store.alerts.list_all(standing=True) if _KIND in each.alert.kinds]
    found = heard(workspace, store, at)
    seen_at = {each.stream.name: _last_seen(store, each) for each in found}
    conditions: list[Condition] = []
    for alert in (each.alert for each in is_open):
        name = _stream_of(alert)
        seen = seen_at.get(name)
        if name not in seen_at:
            why = "bridge.toml does not describe the stream any more"
            conditions.append(Condition(alert, "over", why))
        elif seen is not None and seen > alert.time:
            conditions.append(Condition(alert, "over", f"stream {name} sees its hanger again"))
    known = {_stream_of(each.alert) for each in is_open}
    for each in found:
        since = seen_at[each.stream.name]
        is_unseen = each.state in _UNSEEN and since is not None and at - since > _LONG
        if since is not None and is_unseen and each.stream.name not in known:
            conditions.append(Condition(_alert(each, since), "holds"))
    hooks = [hook.name for hook in workspace.bridge.hooks]
    store.alerts.settle(reconcile(is_open, conditions), hooks, at)


def _last_seen(store: Store, health: StreamHealth) -> datetime | None:
    """Return when the last window with modes ended; without any, when the stream was heard of."""
    last = next(iter(list_latest_with_modes(store, health.stream.name)), None)
    if last is None:
        return health.heard_at
    return last.window.start + timedelta(seconds=last.window.duration_s)


def _stream_of(alert: Alert) -> str:
    return alert.key.split(":")[2]


def _alert(health: StreamHealth, since: datetime) -> Alert:
    stream, lead = health.stream, _lead(health)
    state = f"{lead.state.rstrip('.')} for longer than a day."
    return Alert(
        key=f"hanger-{stream.hanger}:{_KIND}:{stream.name}:{since:%Y%m%dT%H%M%SZ}",
        hanger=stream.hanger,
        test="",
        time=since,
        message=f"{state} {lead.action} Details: nothing watches what the stream measured until "
        "its sensors see the hanger again; what its logger stored is read once it is back.",
        drifts=(),
        kinds=(_KIND,),
    )


def note_blindness(store: Store, stream: Stream, start: datetime) -> None:
    """Save the events that the windows of a stream up to one do not see the hanger, or a plane."""
    from shm.monitor.sensor_health import SEEN_BEFORE, find_lost_planes, sees_nothing  # compute

    since = start - SEEN_BEFORE
    found = list_windows(store, stream.hanger, since, start + PERIOD)
    events = list_stream_events(store, stream.name, since)
    windows = [each for each in found if each.window.stream == stream.name]
    reported = [each for each in events if each.kind == "lost modes" and each.start <= start]
    event = sees_nothing(windows, reported)
    for each in [event] if event else find_lost_planes(windows, stream, reported):
        store.streams.save_event(each)
