"""Days of raw samples through a real daemon, against the hourly readings that trials make instead.

    python tests/benchmarks/stream_days.py --seed 3200 --hangers 4 --days 7 --loss-day 4

The bridge is that of `tests/worlds/living_bridge.py`, all nuisances on; the first hanger loses 2 %
of its tension. Its loggers send nine minutes of each hour; days become tests, updated as
quickly as can be. The daemon serves in a process
of its own by a clock that goes on an hour whenever it has caught up. Printed are when the loss was
told, and the daily tension against that of `stream_trial.py`, whose hourly readings are made up of
the same bridge.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import groupby
from pathlib import Path

import begin
import numpy as np

from shm.read.chunk_document import chunk_document
from shm.store import Workspace
from shm.store.ring import ring_of
from shm.store.streams import find_progress, list_pooled, list_stream_events
from shm.store.tests import list_test_rows
from shm.values import Hanger
from shm.values.stream import Chunk, PooledReading, Stream
from shm.watch.sensors.stream_watch import StreamOptions, StreamWatch
from shm_daemon.loop import run
from tests.benchmarks.stream_load import processor_s
from tests.benchmarks.stream_trial import as_reading, daily_shift
from tests.benchmarks.stream_windows import described
from tests.helpers.workspaces import QUICK
from tests.worlds import living_bridge as world

START = datetime(2026, 5, 4, tzinfo=UTC)
HOUR, SENT_H = timedelta(hours=1), 0.15
LATER = timedelta(seconds=30)  # than the hour: loggers' clocks are off by seconds
AHEAD_H = 3  # of the bridge, before the daemon is waited for


def serve(folder: str, seconds: object) -> None:
    """The daemon, whose clock tells the seconds since `START` that are given."""
    run(Workspace.open(Path(folder)), clock=lambda: START + timedelta(seconds=seconds.value))


def described_bridge(folder: Path, sites: Sequence[tuple[Hanger, Stream]]) -> Workspace:
    lines = ['[bridge]\nname = "Living bridge"', "[settings]", "workers = 1"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in QUICK.items() if key != "workers"]
    for h, _ in sites:
        lines.append(
            f'[[hanger]]\nid = {h.id}\nkind = "{h.kind}"\nlength_m = {h.length_m}\n'
            f"diameter_m = {h.diameter_m}\nelastic_modulus_pa = {h.elastic_modulus_pa}\n"
            f"mass_per_length_kg_m = {h.mass_per_length_kg_m}\narea_m2 = {h.area_m2}\n"
            f"second_moment_m4 = {h.second_moment_m4}\nnominal_tension_n = {h.nominal_tension_n}"
        )
    for h, stream in sites:
        lines.append(
            f'[[stream]]\nname = "{stream.name}"\nhanger = {h.id}\n'
            f"sampling_rate_hz = {stream.sampling_rate_hz}"
        )
        lines += [
            f'[[stream.channel]]\nname = "{c.name}"\nplane = "{c.plane}"\nx_m = {c.x_m}'
            for c in stream.channels
        ]
    config = folder.with_suffix(".toml")
    config.write_text("\n".join(lines))
    return Workspace.initialise(folder, config)


def as_chunk(sent: dict, hour: int) -> Chunk:
    nan = float("nan")
    warm, wind = (nan if sent[k] is None else sent[k] for k in ("temperature_c", "wind_m_s"))
    return Chunk(
        sent["stream"], 60 * hour + sent["sequence"], datetime.fromisoformat(sent["time"]),
        sent["sampling_rate_hz"], tuple(sent["channels"]), sent["values"], warm, wind,
    )  # fmt: skip


def daily(
    hanger: Hanger, readings: Sequence[PooledReading]
) -> tuple[dict[str, float], list[datetime]]:
    """The shift of each day after learning, and when the watch told something."""
    watch, state, found, told = StreamWatch(None, hanger, StreamOptions()), None, {}, []
    for day, group in groupby(readings, key=lambda each: f"{each.start:%m-%d}"):
        hours = [each for each in group if each.modes]
        for each in hours:
            said, state = watch.after(state, each)
            told += [said.alert.time] if said.alert else []
        if state and not state.is_learning and len(hours) > 12:
            found[day] = daily_shift(state, hours)[0]
    return found, told


def main() -> None:
    asked = begin.options(
        __doc__,
        seed=3200,
        hangers="4",
        days=7,
        loss_day=4.0,
        loss=0.02,
        processor_s=begin.Told(900.0, "ends after so many"),
        wall_s=begin.Told(36000.0, "likewise"),
    )
    numbers = [int(each) for each in asked.hangers.split(",")]
    sites = [described(each) for each in world.describe(asked.seed, numbers)]
    at = START + timedelta(days=asked.loss_day, hours=7.4)
    changes = [world.Change("tension_loss", numbers[0], at, asked.loss)]
    seen: dict[int, float] = {}
    context, begun = multiprocessing.get_context("spawn"), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        workspace = described_bridge(Path(folder) / "bridge", sites)
        clock = context.Value("d", 0.0)
        now = lambda: START + timedelta(seconds=clock.value)  # noqa: E731
        ring = ring_of(workspace, now)
        with workspace.store() as store:
            daemon = context.Process(target=serve, args=(str(workspace.folder), clock))
            daemon.start()
            for hour in range(24 * asked.days):
                first = START + hour * HOUR + LATER
                clock.value = 3600 * (hour + SENT_H) + 35
                every = world.raw(asked.seed, numbers, first, SENT_H, changes)
                ring.append_all([chunk_document(as_chunk(sent, hour)) for sent in every])
                clock.value = 3600 * (hour + 0.9)
                lag_h = AHEAD_H + 1.0
                while lag_h > AHEAD_H:
                    time.sleep(1.0)
                    done = [find_progress(store, stream.name) for _, stream in sites]
                    lag_h = max((now() - (each or START)) / HOUR for each in done)
                    if not daemon.is_alive():
                        raise SystemExit("the daemon has ended")
                used_s = processor_s(os.getpid(), seen)
                if hour % 24 == 23:
                    print(f"day {hour // 24 + 1}: processor {used_s:.0f} s", flush=True)
                if used_s > asked.processor_s or time.monotonic() - begun > asked.wall_s:
                    break
            clock.value += 7200
            time.sleep(60.0)
            alerts = store.alerts.list_all()
            read = {h.id: list_pooled(store, h.id, "hour", START, now()) for h, _ in sites}
            tests = {h.id: len(list_test_rows(store, h.id)) for h, _ in sites}
            events = list_stream_events(store, None, START)
            daemon.terminate()
            daemon.join(30)
    days = (hour + 1) / 24
    for each in alerts:
        after = (each.alert.time - at) / HOUR
        print(f"alert {after:+.1f} h: {each.alert.key}: {each.alert.message[:160]}")
    kinds = sorted({(each.stream, each.kind) for each in events})
    print(json.dumps({"tests": tests, "events": kinds}))
    for h, stream in sites:
        own, _ = daily(h, read[h.id])
        made = world.hourly(asked.seed, h.id, days / 365.25, changes, start=START)
        short, told = daily(h, [replace(as_reading(each), stream=stream.name) for each in made])
        days_of = [day for day in own if day in short]
        apart = np.array([own[day] - short[day] for day in days_of] or [float("nan")])
        print(
            f"hanger {h.id}: {len(read[h.id])} hours; {len(days_of)} days, daemon less shortcut "
            f"{100 * apart.mean():+.3f} % in the mean, {100 * apart.std():.3f} % its sd, at most "
            f"{100 * np.abs(apart).max():.3f} %; the shortcut told "
            f"{[round((each - at) / HOUR, 1) for each in told]} h after",
        )
        print({day: (round(100 * own[day], 3), round(100 * short[day], 3)) for day in days_of})


if __name__ == "__main__":
    main()
