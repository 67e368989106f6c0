"""Thermometers of one bridge against each other."""

from __future__ import annotations

from datetime import datetime, timedelta

from shm.store import Store, Workspace
from shm.values.stream import PooledReading

_COMPARED = timedelta(days=1)  # the sun's round: it warms one side first


def compare_thermometers(workspace: Workspace, store: Store, at: datetime) -> None:
    """Notes which streams' thermometers differ from the others over the last day."""
    streams = workspace.bridge.streams
    if len(streams) < 2:
        return
    from shm.watch.stream_thermometer import disagreeing  # it computes

    hours: dict[str, list[PooledReading]] = {stream.name: [] for stream in streams}
    for hanger in dict.fromkeys(stream.hanger for stream in streams):
        for each in store.streams.list_pooled(hanger, "hour", at - _COMPARED, at):
            hours.get(each.stream, []).append(each)
    for event in disagreeing(hours):
        store.streams.save_event(event)
