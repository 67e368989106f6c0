"""Workspaces whose hangers have permanent sensors that live, and the work on their streams."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

from shm.pipeline.streaming import Streaming
from shm.read.chunk_document import chunk_document
from shm.simulate.ambient import MonitoringPlan, described_stream, streamed
from shm.store import Workspace
from shm.store.ring import ring_of
from tests.helpers.flows import Clock

FIRST = datetime(2026, 6, 1, 22, tzinfo=UTC)
HOUR = timedelta(hours=1)
CALM = MonitoringPlan(chunk_s=600.0, trains_a_day=0.0, knocks_a_day=0.0)
_FEW_MODES_HZ = 64.0  # so that a window takes a tenth of a second


def with_live_streams(made: Workspace, sampling_rate_hz: float = _FEW_MODES_HZ) -> Workspace:
    """The same workspace with a stream of four channels for each hanger."""
    with (made.folder / "bridge.toml").open("a") as file:
        for hanger in made.bridge.hangers:
            stream = described_stream(hanger, sampling_rate_hz)
            file.write(
                f'\n[[stream]]\nname = "{stream.name}"\nhanger = {hanger.id}\n'
                f"sampling_rate_hz = {sampling_rate_hz}\n"
            )
            for each in stream.channels:
                file.write(
                    f'[[stream.channel]]\nname = "{each.name}"\nplane = "{each.plane}"\n'
                    f"x_m = {each.x_m}\n"
                )
    return made.reopened()


def send(
    workspace: Workspace,
    hours: float,
    *,
    first: datetime = FIRST,
    seed: int = 3,
    at: datetime | None = None,
    **said: float,
) -> None:
    """Send some hours of the first stream in chunks of ten minutes, each at its end or all `at`."""
    stream, hanger = workspace.bridge.streams[0], workspace.bridge.hangers[0]
    for chunk in streamed(hanger, stream, CALM, first, hours * 3600, seed):
        ring = ring_of(workspace, lambda now=at or chunk.end: now)  # type: ignore[misc]
        ring.append(chunk_document(replace(chunk, **said)))


def drain(streaming: Streaming, clock: Clock) -> None:
    """Works until nothing is left, each turn at a later time so that chunks are sealed."""
    idle = 0
    while idle < 3:
        streaming.note_sealed(streaming.ring.seal(clock()))
        idle = 0 if streaming.advance() else idle + 1
        for running in streaming.under_way:
            running.exception(timeout=120)
        clock.pass_by(30)
