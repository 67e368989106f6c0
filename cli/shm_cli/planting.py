"""Read what `shm simulate` plants, and send streams of simulated sensors."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import islice

import rich_click as click

from shm.errors import NothingThere, UsageError
from shm.pipeline import utc_now
from shm.read.chunk_document import chunk_document
from shm.simulate import PlantedEffect
from shm.simulate.ambient import Loss, MonitoringPlan, streamed
from shm.store import Workspace
from shm.store.ring import ring_of
from shm.values import AddedMass, Hanger
from shm.values.stream import Chunk, Stream
from shm_cli import flags
from shm_cli.common import advancing_bar, show


def effect_of(text: str) -> PlantedEffect:
    """Read `NAME:AT:param=value,...`; raises UsageError where it is not that."""
    name, _, rest = text.partition(":")
    at, _, pairs = rest.partition(":")
    try:
        values = dict(_pair(pair) for pair in pairs.split(","))
    except ValueError:
        raise UsageError(
            f"--effect {text!r} is not NAME:AT:param=value,...",
            remedy="Write --effect 'point_mass:everywhere:mass_kg=12,x_m=3.4'.",
        ) from None
    return PlantedEffect(name, at, values)


def _pair(text: str) -> tuple[str, float]:
    name, value = text.split("=")
    return name.strip(), float(value)


def mass_of(text: str | None) -> AddedMass | None:
    """Read `KG:X` or `KG:X:RADIUS`; raises UsageError where it is neither."""
    if text is None:
        return None
    try:
        mass_kg, x_m, *radius_m = (float(part) for part in text.split(":", 2))
    except ValueError:
        raise UsageError(
            f"--added-mass {text!r} is not KG:X or KG:X:RADIUS.",
            remedy="Write --added-mass 25:3.6, or 25:3.6:0.08.",
        ) from None
    return AddedMass(mass_kg, x_m, *radius_m)


_DAY_S = 86400.0
_LIVE_S, _FAST_S = 60.0, 600.0
"""Technical: of a chunk; loggers send each minute, and each file costs a disk some 10 ms."""
_AT_ONCE = 6  # technical: 20 MB of memory, and folders are synchronised once for all


@dataclass(frozen=True)
class Live:
    """Simulated streams; `speed` is seconds on the bridge per second here, 0 for no limit."""

    days: float
    first: datetime | None
    losses: tuple[str, ...]
    speed: float
    seed: int


def simulate_streams(workspace: Workspace, chosen: Live) -> None:
    """Send the days of every stream that `bridge.toml` describes; the ends of all are alike.

    Raises NothingThere where it describes none.
    """
    streams = workspace.bridge.streams
    if not streams:
        raise NothingThere(
            "bridge.toml describes no stream.",
            remedy="Describe one there: docs/permanent_sensors.md shows how.",
        )
    first = chosen.first or _whole_hour(utc_now() - timedelta(days=chosen.days))
    losses = tuple(_loss(text, first) for text in chosen.losses)
    plan = MonitoringPlan(losses=losses, chunk_s=_LIVE_S if chosen.speed > 0 else _FAST_S)
    hangers = [workspace.bridge.hanger(stream.hanger) for stream in streams]
    seconds = chosen.days * _DAY_S
    with advancing_bar() as bar:
        sent = send(
            arriving(list(zip(hangers, streams, strict=True)), plan, first, seconds, chosen.seed),
            ring_of(workspace).append_all,
            chosen.speed,
            on_sent=lambda at: bar("simulating", (at - first).total_seconds() / seconds),
        )
    if flags.wants_json():
        ends = first + timedelta(seconds=seconds)
        show({"chunks": sent, "streams": len(streams), "from": first, "until": ends})
    else:
        click.echo(f"{sent} chunks of {len(streams)} streams sent; see `shm stream`.")


def arriving(
    sensed: Sequence[tuple[Hanger, Stream]],
    plan: MonitoringPlan,
    first: datetime,
    seconds: float,
    seed: int,
) -> Iterator[Chunk]:
    """Return the chunks of all streams in the order of time."""
    each = [streamed(hanger, stream, plan, first, seconds, seed) for hanger, stream in sensed]
    return heapq.merge(*each, key=lambda chunk: chunk.start)


def send(
    chunks: Iterator[Chunk],
    take: Callable[[Sequence[bytes]], object],
    speed: float,
    on_sent: Callable[[datetime], None],
) -> int:
    """Send chunks and return their number; with a `speed`, each at its time."""
    begun, start, count = time.monotonic(), None, 0
    while batch := list(islice(chunks, 1 if speed > 0 else _AT_ONCE)):
        start, end = start or batch[0].start, batch[-1].end
        if speed > 0:
            due = (end - start).total_seconds() / speed
            time.sleep(max(0.0, begun + due - time.monotonic()))
        take([chunk_document(chunk) for chunk in batch])
        count += len(batch)
        on_sent(end)
    return count


def _whole_hour(at: datetime) -> datetime:
    return at.astimezone(UTC).replace(minute=0, second=0, microsecond=0)


def _loss(text: str, first: datetime) -> Loss:
    """Read `HANGER:PERCENT:DAY`."""
    try:
        hanger, percent, day = text.split(":")
        return Loss(int(hanger), float(percent) / 100, first + timedelta(days=float(day)))
    except ValueError:
        raise UsageError(
            f"--loss {text!r} is not HANGER:PERCENT:DAY.",
            remedy="Write --loss 7:2:1.5 for 2 % of hanger 7 after a day and a half.",
        ) from None
