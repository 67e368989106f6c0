"""`shm demo`: the whole job on a bridge of 20 hangers, one of which loses tension.

The bridge of the demo and its season of hammer tests.

`shm demo --live`: a bridge with permanent sensors lives almost four days within a minute or two.
"""

from __future__ import annotations

import heapq
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import islice
from pathlib import Path

import numpy as np
import rich_click as click
from rich.progress import Progress

from shm.bridge.hanger import hanger_of
from shm.documents import dump
from shm.errors import ShmError, UsageError
from shm.modes_document import load_modes, modes_document
from shm.pipeline import utc_now
from shm.pipeline.reporting import hanger_report
from shm.pipeline.stream_state import stream_states, tension_words
from shm.read import write
from shm.read.atomic import replace_text
from shm.read.chunk_document import chunk_document
from shm.report.as_html import as_html
from shm.report.hanger_report import hanger_paper
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.simulate.ambient import Loss, MonitoringPlan, described_stream, streamed
from shm.store import Stage, Store, StoredAlert, Workspace
from shm.store.recordings import count_stages, list_recordings
from shm.store.ring import ring_of
from shm.store.streams import find_progress
from shm.values import Hanger
from shm_cli import example, flags
from shm_cli.common import counting_bar

# A story: two hangers, of whose days the watch learns three; then one loses as much as nobody sees.
# At 64 Hz, and in chunks of ten minutes, so that two cores are done in a minute.
LIVE_HANGERS, LIVE_LOSING, LIVE_LOSS = 2, 2, 0.02
DAYS, LOST_AFTER_DAYS = 3.75, 3.1
_RATE_HZ = 64.0
_SEED = 2026
_WINDOWS_A_DAY = 144
_AT_ONCE = 6  # technical: chunks in 20 MB of memory; folders are synchronised once for all


def live_description() -> str:
    """Return `bridge.toml` of the bridge, its hangers and their streams."""
    tables = [
        '[bridge]\nname = "Bridge that lives"',
        '[[hook]]\nname = "file"\ncommand = ["tee", "-a", "alerts.jsonl"]',
        '[settings]\nsamples = 400\nworkers = 2\nmodels = "beam1,beam2,beam3"',
    ]
    for number in range(1, LIVE_HANGERS + 1):
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
    """Send the days of all streams into the ring; when they end."""
    now = utc_now().replace(minute=0, second=0, microsecond=0)
    first = now - timedelta(days=DAYS)
    lost = Loss(LIVE_LOSING, LIVE_LOSS, first + timedelta(days=LOST_AFTER_DAYS))
    plan = MonitoringPlan(chunk_s=600.0, losses=(lost,))
    streams = workspace.bridge.streams
    of_streams = [
        streamed(workspace.bridge.hanger(each.hanger), each, plan, first, DAYS * 86400, _SEED)
        for each in streams
    ]
    chunks = heapq.merge(*of_streams, key=lambda chunk: chunk.start)
    ring = ring_of(workspace)
    with counting_bar() as bar:
        task = bar.add_task("days of wind and traffic", total=round(DAYS * _WINDOWS_A_DAY))
        while batch := list(islice(chunks, _AT_ONCE)):
            ring.append_all([chunk_document(chunk) for chunk in batch])
            bar.update(task, completed=(batch[-1].end - first) / timedelta(minutes=10))
    return now


def await_windows(workspace: Workspace, store: Store, looks: Iterator[int], ends: datetime) -> None:
    """Wait until the daemon has read all streams; `looks` paces, and says when it gives up."""
    names = [each.name for each in workspace.bridge.streams]
    with counting_bar() as bar:
        total = round(DAYS * _WINDOWS_A_DAY * len(names))
        task = bar.add_task("windows read, hours pooled and watched", total=total)
        for _ in looks:
            done = [find_progress(store, name) for name in names]
            left = [ends - at for at in done if at is not None]
            missing = sum(each / timedelta(minutes=10) for each in left)
            bar.update(task, completed=0 if len(left) < len(names) else total - missing)
            if len(left) == len(names) and missing <= 0:
                return


def conclude_live(workspace: Workspace, store: Store, alerts: tuple[StoredAlert, ...]) -> None:
    """Print the alerts; raises ShmError without the alert of the loss."""
    for stored in alerts:
        click.echo(f"ALERT {stored.alert.message}")
    for state in stream_states(workspace, ring_of(workspace), store, utc_now()):
        click.echo(f"Stream {state.stream.name}: tension {tension_words(state.hour)}")
    if LIVE_LOSING not in {stored.alert.hanger for stored in alerts}:
        raise ShmError(f"hanger {LIVE_LOSING} lost {LIVE_LOSS:.0%} and no alert was raised.")
    folder = workspace.folder
    click.echo(f"Look around: shm --workspace {folder} stream; shm --workspace {folder} web")


# A story: a sound hanger, one that loses as much as nobody overlooks, and the thesis's, of which
# nothing is simulated: its printed frequencies are one test, and no bar of ours repeats them. It is
# the one of twenty that is as long, 12 m. The season's last tests were made today, short enough
# that the demo takes a minute or two.
HANGERS = 20
SOUND = 3
LOSING = 7
MEASURED = 18
LOSS = 0.08
SEASON_WEEKS = 12
_PLAN = HammerPlan(seconds_per_hit=8.0, acceleration_noise_m_s2=0.05)
_TENSION_SCATTER = 0.003  # judgement: traffic and warmth between two tests of one hanger


@dataclass(frozen=True)
class PlannedTest:
    """One hammer test to come: the hanger, when, its state then, how warm it is."""

    hanger: Hanger
    time: datetime
    state: HangerState
    temperature_c: float
    seed: tuple[int, int, int]

    @property
    def file_name(self) -> str:
        suffix = "uff" if self.hanger.id % 2 else "csv"
        return f"hanger{self.hanger.id:02d}_{self.time:%Y%m%d}.{suffix}"


def bridge_description() -> str:
    """Return `bridge.toml` of an arch bridge, hanger 18 of which is the thesis's."""
    lines = [
        '[bridge]\nname = "Arch bridge of the demo"',
        '[[hook]]\nname = "file"\ncommand = ["tee", "-a", "alerts.jsonl"]',
        '[settings]\nworkers = 2\nmodels = "beam1,beam2"\n'
        "spool_scan_seconds = 0.5\nspool_stable_seconds = 0.5\nalert_grouping_seconds = 5",
    ]
    for number in range(1, HANGERS + 1):
        name = 'name = "measured for the thesis"\n' if number == MEASURED else ""
        lines.append(
            f"[[hanger]]\nid = {number}\n{name}diameter_m = 0.130\n"
            f"length_m = {_length_m(number):.2f}\nelastic_modulus_pa = 200e9\n"
            "density_kg_m3 = 7800\nnominal_tension_n = 711e3"
        )
    return "\n\n".join(lines) + "\n"


def _length_m(number: int) -> float:
    """Return a length along a parabolic arch, scaled so that hanger 18 has the thesis's 12 m."""
    heights = [4 * x * (1 - x) for x in (number / (HANGERS + 1), MEASURED / (HANGERS + 1))]
    return 12.0 * heights[0] / heights[1]


def drop_measured_test(workspace: Workspace, start: datetime) -> None:
    """Drop the frequencies that the thesis measured, as the one test of their hanger.

    It is dated a week before the `start` of the season.
    """
    (test,) = load_modes(example.MODES_FILE)
    test = replace(test, id="thesis_table_1_1", time=start - timedelta(weeks=1))
    document = modes_document([replace(test, hanger=MEASURED)])
    replace_text(workspace.spool / f"hanger{MEASURED}_measured.modes.json", dump(document))


def season_start(now: datetime) -> datetime:
    """Return when a season begins whose last tests were made within the last three hours."""
    return now.replace(minute=0, second=0, microsecond=0) - timedelta(weeks=SEASON_WEEKS, hours=2)


def planned(hangers: Iterable[Hanger], start: datetime) -> Sequence[PlannedTest]:
    """Return the season from `start` to simulate, by time; none of the measured hanger.

    Hangers 3 and 7 are hit every three weeks, the others at its start, every third again.
    """
    tests = [_planned(hanger, week, start) for hanger in hangers for week in _weeks(hanger.id)]
    return sorted(tests, key=lambda test: test.time)


def _weeks(hanger_id: int) -> Sequence[int]:
    if hanger_id == MEASURED:
        return ()
    if hanger_id in (SOUND, LOSING):
        return range(0, SEASON_WEEKS + 1, 3)
    return (0, 10) if hanger_id % 3 == 2 else (0,)


def _planned(hanger: Hanger, week: int, start: datetime) -> PlannedTest:
    state = _random_state(hanger, np.random.default_rng((_SEED, hanger.id)))
    scatter = np.random.default_rng((_SEED, hanger.id, week)).normal(1, _TENSION_SCATTER)
    lost = LOSS if hanger.id == LOSING and week >= 6 else 0.0
    return PlannedTest(
        hanger=hanger,
        time=start + timedelta(weeks=week, hours=hanger.id / 4),
        state=replace(state, tension_n=state.tension_n * float(scatter) * (1 - lost)),
        temperature_c=8.0 + 1.2 * week,
        seed=(_SEED, hanger.id, week + 1),
    )


def _random_state(hanger: Hanger, rng: np.random.Generator) -> HangerState:
    tension = hanger.nominal_tension_n * rng.uniform(0.85, 1.15)
    k1, k2, k3, k4 = 10 ** rng.uniform(6.8, 8.0, 4)
    return HangerState(tension, k1, k2, k3, k4, damping_ratio=0.0015)


def dropped(tests: Sequence[PlannedTest], workspace: Workspace) -> Iterator[PlannedTest]:
    """Simulate each test and drop its file into the spool."""
    for test in tests:
        recording = hammer_test(
            test.hanger,
            test.state,
            _PLAN,
            np.random.default_rng(test.seed),
            time=test.time,
            temperature_c=test.temperature_c,
            source=test.file_name,
        )
        write(recording, workspace.spool / test.file_name)
        yield test


_MARK = ".shm-demo"
_DAEMON_LIMIT_S = 1800.0  # technical: several times what a slow machine takes


@click.command()
@click.option(
    "--folder",
    type=flags.FOLDER,
    default="shm-demo",
    help="Where to make the workspace; an older demo is replaced.",
)
@click.option("--live", is_flag=True, help="A bridge with permanent sensors instead of a hammer.")
def command(folder: Path, live: bool) -> None:
    """Run everything on a simulated bridge of 20 hangers.

    A season of hammer tests is dropped into the spool of a running daemon. Hanger 7 loses 8 % of
    its tension, an alert is raised, and its report and that of hanger 18 are written. Hanger 18
    is real: its one test holds the frequencies that were measured for the thesis.

    \b
    Example: shm demo --folder /tmp/demo
    """
    if live:
        _live(folder)
        return
    workspace = _fresh_workspace(folder, bridge_description())
    click.echo(f"Workspace {workspace.folder}: 20 hangers, their daemon is starting.", err=True)
    with workspace.store() as store, _daemon(workspace) as daemon, counting_bar() as bar:
        start = season_start(utc_now())
        drop_measured_test(workspace, start)
        tests = planned(workspace.bridge.hangers, start)
        for _ in bar.track(dropped(tests, workspace), len(tests), description=_DROPPING):
            pass
        _await(1 + len(tests), store, daemon, bar, "tests through all stages")
        alerts = _await_alert(store, daemon)
    _conclude(workspace, alerts)


def _live(folder: Path) -> None:
    """Simulate some days of permanent sensors, and print the alert of a loss of 2 %."""
    workspace = _fresh_workspace(folder, live_description())
    click.echo(
        f"Workspace {workspace.folder}: {LIVE_HANGERS} hangers with permanent sensors.", err=True
    )
    with workspace.store() as store, _daemon(workspace) as daemon:
        ends = send_days(workspace)
        await_windows(workspace, store, _watched(store, daemon), ends)
        conclude_live(workspace, store, tuple(_await_alert(store, daemon)))


_DROPPING = f"a season of hammer tests into the spool; hanger {LOSING} loses 8 %"


def _fresh_workspace(folder: Path, text: str) -> Workspace:
    if folder.exists() and any(folder.iterdir()):
        if not (folder / _MARK).is_file():
            raise UsageError(f"{folder} is not empty.", remedy="Name another one with --folder.")
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _MARK).touch()
    description = folder / "described.toml"
    description.write_text(text, encoding="utf-8")
    workspace = Workspace.initialise(folder, description)
    description.unlink()
    return workspace


@contextmanager
def _daemon(workspace: Workspace) -> Iterator[subprocess.Popen[bytes]]:
    """Return a daemon of its own process, ended by SIGTERM; its log stands in the workspace."""
    log = workspace.folder / "daemon.log"
    command_line = [sys.executable, "-m", "shm_daemon", str(workspace.folder)]
    with log.open("wb") as file:
        process = subprocess.Popen(command_line, stderr=file, stdout=file)  # noqa: S603  our own
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(timeout=60)
    if process.returncode:
        raise ShmError(f"the daemon ended with code {process.returncode}.", remedy=f"Read {log}.")


def _await(
    count: int, store: Store, daemon: subprocess.Popen[bytes], bar: Progress, label: str
) -> None:
    """Wait until `count` recordings are through; raises ShmError where the daemon gives up."""
    task = bar.add_task(label, total=count)
    for through in _watched(store, daemon):
        bar.update(task, completed=through)
        if through >= count:
            return


def _watched(store: Store, daemon: subprocess.Popen[bytes], poll_s: float = 0.3) -> Iterator[int]:
    """Yield how many recordings are done, every ``poll_s`` while the daemon lives."""
    deadline = time.monotonic() + _DAEMON_LIMIT_S
    while time.monotonic() < deadline and daemon.poll() is None:
        refused = list_recordings(store, Stage.REFUSED)
        if refused:
            raise ShmError(f"a file of the demo was refused: {refused[0].reason}.")
        yield count_stages(store)[Stage.DONE]
        time.sleep(poll_s)
    raise ShmError("the demo's daemon did not finish.", remedy="Read daemon.log in its folder.")


def _await_alert(store: Store, daemon: subprocess.Popen[bytes]) -> Sequence[StoredAlert]:
    """Return the alerts, once the hook has had them."""
    for _ in _watched(store, daemon):
        alerts, deliveries = store.alerts.list_all(), store.alerts.list_deliveries()
        if not alerts or all(delivery.state == "delivered" for delivery in deliveries):
            return alerts
    return ()


def _conclude(workspace: Workspace, alerts: Sequence[StoredAlert]) -> None:
    """Print the result and the paths of the reports; raises ShmError without the alert."""
    for stored in alerts:
        click.echo(f"ALERT {stored.alert.message}")
    if LOSING not in {stored.alert.hanger for stored in alerts}:
        raise ShmError(f"hanger {LOSING} lost 8 % and no alert was raised.")
    click.echo(f"Delivered to the hook: {workspace.folder / 'alerts.jsonl'}")
    with workspace.store() as store:
        for hanger_id in (MEASURED, LOSING):
            content = hanger_report(workspace, store, hanger_id, utc_now())
            path = workspace.folder / f"hanger{hanger_id}.html"
            path.write_text(as_html(hanger_paper(content)), encoding="utf-8")
            click.echo(f"Report of hanger {hanger_id}: {path}")
    click.echo(f"Look around: shm --workspace {workspace.folder} status")
