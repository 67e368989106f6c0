"""Workspaces whose hangers have permanent sensors that live, and the work on their streams.

`found_in` makes up what a window says, so that a test of the flow computes none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from shm.models.classes.tensioned_beam import frequencies_hz
from shm.pipeline.stream_steps import WindowFound
from shm.pipeline.streaming import Streaming
from shm.read.chunk_document import chunk_document
from shm.simulate.ambient import MonitoringPlan, described_stream, streamed
from shm.store import Workspace
from shm.store.ring import ring_of
from shm.values import PLANES, Hanger, Mode
from shm.values.stream import Piece, Stream, Window, WindowReading, period_start
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


def found_in(
    stream: Stream,
    hanger: Hanger,
    start: datetime,
    seed: int,
    temperature_c: float = 10.0,
    factor: float = 1.0,
) -> WindowFound:
    """Make up a window: three exact modes a plane by a `factor` of the tension, and noise."""
    draw = np.random.default_rng(seed)
    each = (hanger.length_m, factor * hanger.nominal_tension_n, hanger.bending_stiffness_n_m2)
    springs = (hanger.mass_per_length_kg_m, 3e5, 3e5)
    hz = frequencies_hz(*map(np.asarray, (*each, *springs)), modes=3)
    modes = tuple(
        Mode(plane, order, float(own), 2e-4 * float(own))
        for plane in PLANES
        for order, own in enumerate(hz * (1 + 2e-4 * draw.normal(size=3)), 1)
    )
    window = Window(stream.name, hanger.id, start, 600.0, "wind", 0.02, temperature_c=temperature_c)
    return WindowFound(WindowReading(window, modes, "tracked"), ())


def find_quickly(
    pieces: Sequence[Piece], stream: Stream, known: object, hanger: Hanger, *_: object
) -> WindowFound:
    """Stand in for `read_stream_window`."""
    start = period_start(pieces[0].start, timedelta(minutes=10))
    return found_in(stream, hanger, start, start.minute, pieces[0].temperature_c)
