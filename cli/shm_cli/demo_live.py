"""`shm demo --live`: a bridge with permanent sensors lives four days within some minutes."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

import rich_click as click

from shm.bridge.hanger import hanger_of
from shm.errors import ShmError
from shm.pipeline import utc_now
from shm.pipeline.stream_state import stream_states, tension_words
from shm.simulate.monitored import Loss, MonitoringPlan, described_stream
from shm.store import Store, StoredAlert, Workspace
from shm.store.ring import ring_of
from shm_cli.common import counting_bar
from shm_cli.simulate_stream import arriving, send

# A story: three hangers, four days, of which the watch learns three; then one loses as much as
# nobody sees. At 100 Hz, and in chunks of ten minutes, so that two cores are done in two minutes.
HANGERS, LOSING, LOSS = 3, 2, 0.02
DAYS, LOST_AFTER_DAYS = 4.25, 3.5
_RATE_HZ = 100.0
_SEED = 2026
_WINDOWS_A_DAY = 144


def live_description() -> str:
    """`bridge.toml` of the bridge, its hangers and their streams."""
    tables = [
        '[bridge]\nname = "Bridge that lives"',
        '[[hook]]\nname = "file"\ncommand = ["tee", "-a", "alerts.jsonl"]',
        '[settings]\nsamples = 400\nworkers = 2\nmodels = "beam1,beam2,beam3"',
    ]
    for number in range(1, HANGERS + 1):
        described = {
            "id": number, "diameter_m": 0.09, "length_m": 8.0 + 2.0 * number,
            "elastic_modulus_pa": 200e9, "density_kg_m3": 7800, "nominal_tension_n": 400e3,
        }  # fmt: skip
        lines = "\n".join(f"{key} = {value}" for key, value in described.items())
        stream = described_stream(hanger_of(described, Path("bridge.toml")), _RATE_HZ)
        tables.append(f"[[hanger]]\n{lines}")
        tables.append(
            f'[[stream]]\nname = "{stream.name}"\nhanger = {number}\nsampling_rate_hz = {_RATE_HZ}'
        )
        tables += [
            f'[[stream.channel]]\nname = "{each.name}"\nplane = "{each.plane}"\nx_m = {each.x_m}'
            for each in stream.channels
        ]
    return "\n\n".join(tables) + "\n"


def send_days(workspace: Workspace) -> datetime:
    """Sends the days of all streams into the ring; when they end."""
    now = utc_now().replace(minute=0, second=0, microsecond=0)
    first = now - timedelta(days=DAYS)
    lost = Loss(LOSING, LOSS, first + timedelta(days=LOST_AFTER_DAYS))
    plan = MonitoringPlan(chunk_s=600.0, losses=(lost,))
    streams = workspace.bridge.streams
    sensed = [(workspace.bridge.hanger(each.hanger), each) for each in streams]
    chunks = arriving(sensed, plan, first, DAYS * 86400, _SEED)
    with counting_bar() as bar:
        task = bar.add_task("four days of wind and traffic", total=round(DAYS * _WINDOWS_A_DAY))

        def told(at: datetime) -> None:
            bar.update(task, completed=(at - first) / timedelta(minutes=10))

        send(chunks, ring_of(workspace).append_all, 0.0, told)
    return now


def await_windows(workspace: Workspace, store: Store, looks: Iterator[int], ends: datetime) -> None:
    """Waits until the daemon has read all streams; `looks` paces, and says when it gives up."""
    names = [each.name for each in workspace.bridge.streams]
    with counting_bar() as bar:
        total = round(DAYS * _WINDOWS_A_DAY * len(names))
        task = bar.add_task("windows read, hours pooled and watched", total=total)
        for _ in looks:
            done = [store.streams.progress(name) for name in names]
            left = [ends - at for at in done if at is not None]
            missing = sum(each / timedelta(minutes=10) for each in left)
            bar.update(task, completed=0 if len(left) < len(names) else total - missing)
            if len(left) == len(names) and missing <= 0:
                return


def conclude_live(workspace: Workspace, store: Store, alerts: tuple[StoredAlert, ...]) -> None:
    """Says what was told; raises ShmError without the alert of the loss."""
    for stored in alerts:
        click.echo(f"ALERT {stored.alert.message}")
    for state in stream_states(workspace, ring_of(workspace), store, utc_now()):
        click.echo(f"Stream {state.stream.name}: tension {tension_words(state.hour)}")
    if LOSING not in {stored.alert.hanger for stored in alerts}:
        raise ShmError(f"hanger {LOSING} lost {LOSS:.0%} and no alert was raised.")
    folder = workspace.folder
    click.echo(f"Look around: shm --workspace {folder} stream; shm --workspace {folder} web")
