"""Streams that say nothing: an alert of each silence that is longer than a day, over once it ends;
an event of each that sends and sees nothing of its hanger.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from shm.pipeline.unheard import Heard, heard
from shm.store import Store, StoredAlert, Workspace
from shm.values import Alert, AlertKind
from shm.values.messages import WEEK
from shm.values.stream import Stream

_KIND: AlertKind = "silent"
_LONG = timedelta(hours=26)
"""judgement: what a logger begins anew by itself, or sends as one file a day, needs nobody."""


def heed_silences(workspace: Workspace, store: Store, at: datetime) -> None:
    """Raises and ends what the silence of streams calls for."""
    found = {each.stream.name: each for each in heard(workspace, store, at)}
    standing = [each for each in store.alerts.list_all(standing=True) if _KIND in each.alert.kinds]
    ended = {each.id: why for each in standing if (why := _why_ended(found.get(_stream(each))))}
    told = {_stream(each) for each in standing}
    hooks = [hook.name for hook in workspace.bridge.hooks]
    if ended:
        store.alerts.settle(None, hooks, ended, at)
    for name, each in found.items():
        last = each.last_sample
        if name not in told and each.state == "silent" and last and at - last > _LONG:
            store.alerts.settle(_alert(each, last), hooks, {}, at)


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


def _stream(stored: StoredAlert) -> str:
    return stored.alert.key.split(":")[2]


def _why_ended(now: Heard | None) -> str:
    if now is None:
        return "bridge.toml does not describe the stream any more"
    return "" if now.state == "silent" else f"stream {now.stream.name} sends again"


def _alert(silent: Heard, last: datetime) -> Alert:
    stream = silent.stream
    return Alert(
        key=f"hanger-{stream.hanger}:{_KIND}:{stream.name}:{last:%Y%m%dT%H%M%SZ}",
        hanger=stream.hanger,
        test="",
        time=last,
        message=f"Hanger {stream.hanger}: its stream {silent.named} is silent for longer than a "
        f"day. Look at its logger, power and connection {WEEK}. Details: nothing watches what the "
        "stream measured; what its logger stored is read once it is back.",
        drifts=(),
        kinds=(_KIND,),
    )
