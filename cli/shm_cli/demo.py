"""`shm demo`: the whole job on a bridge of 20 hangers, one of which loses tension."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import rich_click as click
from rich.progress import Progress

from shm import report
from shm.errors import ShmError, UsageError
from shm.pipeline import utc_now
from shm.pipeline.reporting import hanger_report
from shm.store import Stage, Store, StoredAlert, Workspace
from shm_cli import season
from shm_cli.common import counting_bar

_MARK = ".shm-demo"
_DAEMON_LIMIT_S = 600.0
_POLL_S = 0.3


@click.command()
@click.option(
    "--folder",
    type=click.Path(file_okay=False, path_type=Path),
    default="shm-demo",
    show_default=True,
    help="Where to make the workspace; an older demo is replaced.",
)
def command(folder: Path) -> None:
    """See the whole job on a simulated bridge of 20 hangers.

    Hanger 3 starts from the real frequencies of the thesis. A season of hammer tests is dropped
    into the spool of a running daemon; hanger 7 loses 8 % of its tension; the alert fires; the
    reports are written.

    \b
    Example: shm demo --folder /tmp/demo
    """
    workspace = _fresh_workspace(folder)
    click.echo(f"Workspace {workspace.folder}: 20 hangers, their daemon is starting.", err=True)
    with workspace.store() as store, _daemon(workspace) as daemon, counting_bar() as bar:
        season.drop_measured_baseline(workspace)
        _await(1, store, daemon, bar, "hanger 3, measured: model classes compared")
        tests = season.planned(workspace, store)
        for _ in bar.track(season.dropped(tests, workspace), len(tests), description=_DROPPING):
            pass
        _await(1 + len(tests), store, daemon, bar, "tests through all stages")
        alerts = _await_alert(store, daemon)
    _conclude(workspace, alerts)


_DROPPING = f"a season of hammer tests into the spool; hanger {season.LOSING} loses 8 %"


def _fresh_workspace(folder: Path) -> Workspace:
    if folder.exists() and any(folder.iterdir()):
        if not (folder / _MARK).is_file():
            raise UsageError(f"{folder} is not empty.", remedy="Name another one with --folder.")
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _MARK).touch()
    description = folder / "described.toml"
    description.write_text(season.bridge_description(), encoding="utf-8")
    workspace = Workspace.initialise(folder, description)
    description.unlink()
    return workspace


@contextmanager
def _daemon(workspace: Workspace) -> Iterator[subprocess.Popen[bytes]]:
    """A daemon of its own process, ended by SIGTERM; its log stands in the workspace."""
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
    """Waits until `count` recordings are through; raises ShmError where the daemon gives up."""
    task = bar.add_task(label, total=count)
    for through in _watched(store, daemon):
        bar.update(task, completed=through)
        if through >= count:
            return


def _watched(store: Store, daemon: subprocess.Popen[bytes]) -> Iterator[int]:
    """How many recordings are through, again and again while the daemon lives."""
    deadline = time.monotonic() + _DAEMON_LIMIT_S
    while time.monotonic() < deadline and daemon.poll() is None:
        refused = store.recordings(Stage.REFUSED)
        if refused:
            raise ShmError(f"a file of the demo was refused: {refused[0].reason}.")
        yield store.stage_counts()[Stage.DONE]
        time.sleep(_POLL_S)
    raise ShmError("the demo's daemon did not finish.", remedy="Read daemon.log in its folder.")


def _await_alert(store: Store, daemon: subprocess.Popen[bytes]) -> Sequence[StoredAlert]:
    """The alerts, once the hook has had them."""
    for _ in _watched(store, daemon):
        alerts, deliveries = store.alerts(), store.deliveries()
        if not alerts or all(delivery.state == "delivered" for delivery in deliveries):
            return alerts
    return ()


def _conclude(workspace: Workspace, alerts: Sequence[StoredAlert]) -> None:
    """Says what was found and where the reports are; raises ShmError without the alert."""
    for stored in alerts:
        click.echo(f"ALERT {stored.alert.message}")
    if season.LOSING not in {stored.alert.hanger for stored in alerts}:
        raise ShmError(f"hanger {season.LOSING} lost 8 % and no alert was raised.")
    click.echo(f"Delivered to the hook: {workspace.folder / 'alerts.jsonl'}")
    with workspace.store() as store:
        for hanger_id in (season.MEASURED, season.LOSING):
            content = hanger_report(workspace, store, hanger_id, utc_now())
            path = workspace.folder / f"hanger{hanger_id}.html"
            path.write_text(report.html(content), encoding="utf-8")
            click.echo(f"Report of hanger {hanger_id}: {path}")
    click.echo(f"Look around: shm --workspace {workspace.folder} status")
