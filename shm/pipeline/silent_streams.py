"""Streams that say nothing of their hanger, silent ones and those that send and see nothing of it:
an event of each that begins to see nothing, an alert of what lasts for a day, over once it ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta

from shm.pipeline.unheard import Heard, blind_hangers, heard
from shm.store import Store, StoredAlert, Workspace
from shm.values import Alert, AlertKind
from shm.values.stream import Stream

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


def heed_silences(workspace: Workspace, store: Store, at: datetime) -> None:
    """Raises and ends what streams call for that say nothing."""
    found = {each.stream.name: each for each in heard(workspace, store, at)}
    standing = [each for each in store.alerts.list_all(standing=True) if _KIND in each.alert.kinds]
    ended = {each.id: why for each in standing if (why := _why_ended(each, found))}
    told = {_told(each) for each in standing}
    hooks = [hook.name for hook in workspace.bridge.hooks]
    if ended:
        store.alerts.settle(None, hooks, ended, at)
    for name, each in found.items():
        word, last = _WORD.get(each.state, ""), each.last_sample
        if not word or last is None or (word, name) in told:
            continue
        since = last if word == "silent" else _blind_since(store, name, at)
        if at - since > _LONG:
            store.alerts.settle(_alert(each, word, since), hooks, {}, at)


def _blind_since(store: Store, name: str, at: datetime) -> datetime:
    """Since when a stream has seen nothing; no longer ago than twice what an alert takes."""
    since = None
    for each in reversed(store.streams.list_events(name, at - 2 * _LONG)):
        if each.kind == "lost modes":
            if since and since - each.end > _BROKEN_OFF:
                break
            since = min(since or at, each.start)
    return since or at


def note_blindness(store: Store, stream: Stream, start: datetime) -> None:
    """Notes that a stream sees nothing of its hanger where its windows up to one show it."""
    from shm.monitor.sensor_health import SEEN_BEFORE, sees_nothing  # they compute
    from shm.store.ring_files import PERIOD

    since = start - SEEN_BEFORE
    found = store.streams.list_windows(stream.hanger, since, start + PERIOD)
    events = store.streams.list_events(stream.name, since)
    event = sees_nothing(
        [each for each in found if each.window.stream == stream.name],
        [each for each in events if each.kind == "lost modes" and each.start <= start],
    )
    if event is not None:
        store.streams.save_event(event)


def _told(stored: StoredAlert) -> tuple[str, str]:
    """Of which state of which stream an alert is."""
    _, word, stream, *_ = stored.alert.key.split(":")
    return word, stream


def _why_ended(stored: StoredAlert, found: Mapping[str, Heard]) -> str:
    word, name = _told(stored)
    if name not in found:
        return "bridge.toml does not describe the stream any more"
    if found[name].state in _HELD[word]:
        return ""
    return f"stream {name} {'sends' if word == 'silent' else 'sees its hanger'} again"


def _alert(told: Heard, word: str, since: datetime) -> Alert:
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
