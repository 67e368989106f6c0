"""Find permanent sensors that are silent or disagree with the others.

What `shm doctor`, the pages and the messages tell alike. An event of each stream that begins to see
nothing, an alert of what lasts for a day, over once it ends; thermometers against each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Literal

from shm.pipeline.reconcile import Condition, reconcile
from shm.store import Store, StoredAlert, Workspace
from shm.store.queries.streams import (
    find_progress,
    list_pooled,
    list_stream_events,
    list_window_starts,
    list_windows,
)
from shm.values import Alert, AlertKind
from shm.values.messages import WEEK, Lead
from shm.values.rounding import listed
from shm.values.stream import PooledReading, Stream, StreamEvent

if TYPE_CHECKING:
    from shm.store.ring import Ring

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
class StreamHealth:
    """A stream and how it is, by its last sample; `unread` is how much the watch has not read."""

    stream: Stream
    state: State
    last_sample: datetime | None
    unread: timedelta = timedelta(0)

    @property
    def named(self) -> str:
        last = self.last_sample
        since = f" (last sample {last:%Y-%m-%d %H:%M} UTC)" if last else ""
        return f"{self.stream.name}{since}"


def heard(workspace: Workspace, store: Store, now: datetime) -> tuple[StreamHealth, ...]:
    """Each stream that `bridge.toml` describes, in its order."""
    if not workspace.bridge.streams:
        return ()
    # It brings h5py, and most bridges have no streams.
    from shm.store.ring import ring_of

    ring = ring_of(workspace)
    last = last_samples(workspace, ring, store)
    return tuple(
        StreamHealth(
            each,
            classify_stream(
                last[each.name], list_stream_events(store, each.name, now - LATELY), now
            ),
            last[each.name],
            measure_unread(workspace, ring, store, each.name, now),
        )
        for each in workspace.bridge.streams
    )


def last_samples(workspace: Workspace, ring: Ring, store: Store) -> dict[str, datetime | None]:
    """Return when the last sample of each described stream ended, None where it never sent.

    Where the ring is empty, after a restore or a long silence, it is when the last window ended.
    """
    latest = ring.latest()
    names = [stream.name for stream in workspace.bridge.streams]
    return {name: latest.get(name) or find_progress(store, name) for name in names}


def classify_stream(last: datetime | None, events: Sequence[StreamEvent], now: datetime) -> State:
    """Return how a stream is by its last sample and the `events` of a day."""
    if last is None:
        return "never sent"
    if last - now > _AHEAD:  # whether it still sends cannot be told by its stamps
        return "clock ahead"
    if now - last > _SILENT:
        return "silent"
    if now - last > _LATE:
        return "late"
    standing = [e for e in events if last - e.end < _STANDS.get(e.kind, _FAULT_STANDS)]
    if any(each.kind == "lost modes" and not each.channel for each in standing):
        return "sees nothing"
    return "sensor at fault" if any(each.kind in _AT_FAULT for each in standing) else "live"


def stream_leads(workspace: Workspace, store: Store, now: datetime) -> tuple[Lead, ...]:
    """Return what somebody should know of the streams and of the ring of their samples."""
    found = heard(workspace, store, now)
    return (*leads_of(found), *backlog_leads(found), *ring_leads(workspace))


def backlog_leads(
    found: Sequence[StreamHealth], longest: timedelta = timedelta(hours=1)
) -> tuple[Lead, ...]:
    """Return what to say of streams of which more than `longest` is not read yet."""
    behind = [each for each in found if each.unread > longest]
    if not behind:
        return ()
    names = [
        f"{each.stream.name} ({each.unread / timedelta(hours=1):.3g} hours)" for each in behind
    ]
    more = ["others"] if names[_NAMED:] else []
    what = "Streams" if names[1:] else "Stream"
    return (
        Lead(
            f"{what} {listed([*names[:_NAMED], *more])}: samples are not read yet, so the watch is "
            "behind.",
            "Start `shm daemon` if none is active; if one is, give it more processors and raise "
            "the setting workers.",
        ),
    )


def leads_of(found: Sequence[StreamHealth]) -> tuple[Lead, ...]:
    """Of each state that somebody should know of, the streams that are in it, and the remedy."""
    leads = []
    for state, remedy in REMEDIES.items():
        own = [each.named for each in found if each.state == state]
        if own:
            more = ["others"] if own[_NAMED:] else []
            what = "Streams" if own[1:] else "Stream"
            leads.append(Lead(f"{what} {listed([*own[:_NAMED], *more])}: {state}.", remedy))
    return tuple(leads)


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
    read = list_window_starts(store, stream, begin)
    return tuple(start for start in ring.periods(stream, begin) if start not in read)


def measure_unread(
    workspace: Workspace, ring: Ring, store: Store, stream: str, now: datetime
) -> timedelta:
    """Return the length of all ten minutes with samples that the watch has not read."""
    from shm.values.stream import PERIOD

    unread = set(list_unread(workspace, ring, store, stream, now))
    return len(unread | ring.unsealed_periods(stream)) * PERIOD


def sweep_ring(workspace: Workspace, ring: Ring, store: Store, now: datetime) -> None:
    """Remove old samples from the ring, but none that the watch has yet to read."""
    settings = workspace.settings
    names = [stream.name for stream in workspace.bridge.streams]
    unread = {name: list_unread(workspace, ring, store, name, now) for name in names}
    ring.sweep(now, settings.ring_days, settings.ring_bytes, unread)


def ring_leads(workspace: Workspace) -> tuple[Lead, ...]:
    """Return what to say of a ring that is larger than `ring_bytes` though it was swept."""
    if not (workspace.folder / "ring").is_dir():
        return ()
    from shm.store.ring import ring_of  # it brings h5py, and most bridges have no streams

    limit, swept = workspace.settings.ring_bytes, ring_of(workspace).last_sweep()
    if swept is None:
        return ()
    held = {
        "are unread": swept.unread_bytes,
        "are of the last day": swept.recent_bytes,
        "are kept for good until their file in ring/NAME/kept/ is removed": swept.kept_bytes,
    }
    if sum(held.values()) <= limit:  # the next sweep meets it
        return ()
    parts = [f"{_gigabytes(size)} {what}" for what, size in held.items() if size]
    return (
        Lead(
            f"The ring holds {_gigabytes(swept.left_bytes)}, more than ring_bytes "
            f"({_gigabytes(limit)}), and nothing more may be removed.",
            f"Raise ring_bytes in bridge.toml: {listed(parts)}.",
        ),
    )


def _gigabytes(size: int) -> str:
    return f"{size / 1e9:.3g} GB"


def blind_hangers(found: Sequence[StreamHealth]) -> dict[int, Lead]:
    """Return what is said first of each hanger whose stream says nothing."""
    leads = {}
    for each in found:
        if each.state in _BLIND:
            what, action = _BLIND[each.state]
            hanger = each.stream.hanger
            leads[hanger] = Lead(f"Hanger {hanger}: its stream {each.named} is {what}.", action)
    return leads


_KIND: AlertKind = "silent"
_WORD = {"silent": "silent", "sees nothing": "blind"}
"""What the key of an alert calls each state that is one."""
_HELD = {"silent": ("silent",), "blind": ("sees nothing", "silent", "late", "clock ahead")}
"""In which states an alert goes on: what sends nothing new does not see its hanger again."""
_DETAILS = {
    "silent": "nothing watches what the stream measured; what its logger stored is read once it is "
    "back.",
    "blind": "nothing watches what the stream measured until its sensors see the hanger again.",
}
_BROKEN_OFF = timedelta(hours=1)  # as `unheard` takes it to be over
_LONG = timedelta(hours=26)
"""judgement: what a logger begins anew by itself, or sends as one file a day, needs nobody."""


def evaluate_silent_streams(workspace: Workspace, store: Store, at: datetime) -> None:
    """Open and close what streams call for that say nothing."""
    found = {each.stream.name: each for each in heard(workspace, store, at)}
    standing = [each for each in store.alerts.list_all(standing=True) if _KIND in each.alert.kinds]
    conditions = [
        Condition(each.alert, "over", why) for each in standing if (why := _why_ended(each, found))
    ]
    told = {_told(each) for each in standing}
    for name, each in found.items():
        word, last = _WORD.get(each.state, ""), each.last_sample
        if not word or last is None or (word, name) in told:
            continue
        since = last if word == "silent" else _blind_since(store, name, at)
        if at - since > _LONG:
            conditions.append(Condition(_alert(each, word, since), "holds"))
    hooks = [hook.name for hook in workspace.bridge.hooks]
    store.alerts.settle(reconcile(standing, conditions), hooks, at)


def _blind_since(store: Store, name: str, at: datetime) -> datetime:
    """Since when a stream has seen nothing; no longer ago than twice what an alert takes."""
    since = None
    for each in reversed(list_stream_events(store, name, at - 2 * _LONG)):
        if each.kind == "lost modes" and not each.channel:
            if since and since - each.end > _BROKEN_OFF:
                break
            since = min(since or at, each.start)
    return since or at


def note_blindness(store: Store, stream: Stream, start: datetime) -> None:
    """Save the events that the windows of a stream up to one do not see the hanger, or a plane."""
    from shm.monitor.sensor_health import SEEN_BEFORE, find_lost_planes, sees_nothing  # compute
    from shm.values.stream import PERIOD

    since = start - SEEN_BEFORE
    found = list_windows(store, stream.hanger, since, start + PERIOD)
    events = list_stream_events(store, stream.name, since)
    windows = [each for each in found if each.window.stream == stream.name]
    reported = [each for each in events if each.kind == "lost modes" and each.start <= start]
    event = sees_nothing(windows, reported)
    for each in [event] if event else find_lost_planes(windows, stream, reported):
        store.streams.save_event(each)


def _told(stored: StoredAlert) -> tuple[str, str]:
    """Of which state of which stream an alert is."""
    _, word, stream, *_ = stored.alert.key.split(":")
    return word, stream


def _why_ended(stored: StoredAlert, found: Mapping[str, StreamHealth]) -> str:
    word, name = _told(stored)
    if name not in found:
        return "bridge.toml does not describe the stream any more"
    if found[name].state in _HELD[word]:
        return ""
    return f"stream {name} {'sends' if word == 'silent' else 'sees its hanger'} again"


def _alert(told: StreamHealth, word: str, since: datetime) -> Alert:
    stream = told.stream
    said = blind_hangers([told])[stream.hanger]
    state = f"{said.state.rstrip('.')} for longer than a day."
    return Alert(
        key=f"hanger-{stream.hanger}:{word}:{stream.name}:{since:%Y%m%dT%H%M%SZ}",
        hanger=stream.hanger,
        test="",
        time=since,
        message=f"{state} {said.action} Details: {_DETAILS[word]}",
        drifts=(),
        kinds=(_KIND,),
    )


_COMPARED = timedelta(days=1)  # the sun's round: it warms one side first


def compare_thermometers(workspace: Workspace, store: Store, at: datetime) -> None:
    """Notes which streams' thermometers differ from the others over the last day."""
    streams = workspace.bridge.streams
    if len(streams) < 2:
        return
    from shm.watch.stream_thermometer import disagreeing  # it computes

    hours: dict[str, list[PooledReading]] = {stream.name: [] for stream in streams}
    for hanger in dict.fromkeys(stream.hanger for stream in streams):
        for each in list_pooled(store, hanger, "hour", at - _COMPARED, at):
            hours.get(each.stream, []).append(each)
    for event in disagreeing(hours):
        store.streams.save_event(event)
