"""Which permanent sensors send nothing, or are at fault."""

from __future__ import annotations

from collections.abc import Iterator

from shm.pipeline.stream_state import stream_states
from shm.report.formatting import counted
from shm.store.ring import ring_of
from shm_daemon.doctor.checks import Examined, Finding, ok, some, warning
from shm_daemon.heartbeat import told

_REMEDIES = {
    "never sent": "Connect its logger: docs/permanent_sensors.md.",
    "silent": "Look at its logger, power and connection; it sends what it stored once it is back.",
    "clock ahead": "Set its clock, to UTC: whether it still sends cannot be told by its stamps.",
    "sensor at fault": "See `shm stream --events`, and its page on the dashboard.",
}


def check_streams(examined: Examined) -> Iterator[Finding]:
    """Nothing where `bridge.toml` describes no stream."""
    workspace = examined.workspace
    states = stream_states(workspace, ring_of(workspace), examined.store, examined.now)
    bad = [each for each in states if each.state in _REMEDIES]
    for word, remedy in _REMEDIES.items():
        names = [
            f"{each.stream.name} ({told(each.lag)})" if each.lag else each.stream.name
            for each in bad
            if each.state == word
        ]
        if names:
            yield warning("streams", f"{word}: {some(names)}", remedy)
    if states and not bad:
        yield ok("streams", f"{counted(len(states), 'stream')}, heard within the hour")
