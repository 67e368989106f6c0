"""`shm ingest`: files through the same path as the daemon's, or a look into them."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rich_click as click

from shm.documents import alert_document
from shm.errors import BadInput, ShmError, StoreError
from shm.pipeline import Flow
from shm.read import bundle
from shm.store import Outcome, Receipt, Stage, Store, StoredRecording, Workspace
from shm.values import Alert
from shm_cli.common import counting_bar, json_option, open_workspace, show, show_table, table
from shm_cli.peek import show_peeks
from shm_daemon.execution import children_ended, process_pool
from shm_daemon.hooks import HookNotifier


@click.command()
@click.argument(
    "files",
    nargs=-1,
    required=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE...",
)
@click.option(
    "--together", is_flag=True, help="The files are one test: hits, or set-ups; kept as one .zip."
)
@click.option("--peek", "look", is_flag=True, help="Only show what is in the files.")
@json_option
@click.pass_context
def command(
    ctx: click.Context, files: tuple[Path, ...], together: bool, look: bool, as_json: bool
) -> int:
    """Take recordings in, or look into them with --peek.

    Each file is archived, identified, updated and watched as the daemon would; it may also be a
    *.modes.json. The files stay where they are. Exit code 3 when any was refused.

    \b
    Example: shm ingest hanger3_*.csv
    """
    if look:
        return show_peeks(files, as_json)
    logging.getLogger("shm").addHandler(logging.NullHandler())  # all is said in the table
    workspace = open_workspace(ctx)
    if together:
        folder = Path(ctx.with_resource(TemporaryDirectory()))
        files = (bundle(files, folder / f"{files[0].stem}.zip"),)
    with workspace.store() as store:
        known = {stored.id for stored in store.alerts()}
        receipts, unreadable = _ingest(workspace, files)
        rows = [
            _row(path, receipt.outcome, store.recording(receipt.recording.id))
            for path, receipt in receipts.items()
        ]
        raised = [stored.alert for stored in store.alerts() if stored.id not in known]
    _show(rows + unreadable, raised, as_json)
    refused = any(row["outcome"] == _REFUSED for row in rows + unreadable)
    return BadInput.exit_code if refused else 0


def _ingest(
    workspace: Workspace, files: Sequence[Path]
) -> tuple[dict[Path, Receipt], list[dict[str, object]]]:
    """Receipts of the files that could be taken in, rows of those that could not."""
    with workspace.lock(), workspace.store() as store, children_ended():
        settings = workspace.settings
        notifier = HookNotifier(workspace.folder, settings.hook_timeout_seconds, os.environ)
        executor = process_pool(settings.workers)
        flow = Flow(workspace, store, executor, notifier=notifier, lanes=settings.workers)
        try:
            receipts, unreadable = _received(flow, files)
            _finish(flow, store, [receipt.recording.id for receipt in receipts.values()])
        finally:
            flow.close()
            notifier.close()
            executor.shutdown(wait=False, cancel_futures=True)
    return receipts, unreadable


def _received(
    flow: Flow, files: Sequence[Path]
) -> tuple[dict[Path, Receipt], list[dict[str, object]]]:
    receipts: dict[Path, Receipt] = {}
    unreadable: list[dict[str, object]] = []
    for path in files:
        try:
            receipts[path] = flow.receive(path)
        except StoreError:
            raise
        except (ShmError, OSError) as error:
            unreadable.append(
                {"file": path.name, "outcome": _REFUSED, "stage": None, "reason": str(error)}
            )
    return receipts, unreadable


def _finish(flow: Flow, store: Store, ids: Sequence[int]) -> None:
    """Works until nothing waits, and counts the recordings that are through."""
    ended = {Stage.DONE, Stage.REFUSED}
    with counting_bar() as bar:
        task = bar.add_task("ingesting", total=len(ids))

        def count() -> None:
            through = sum(store.recording(recording_id).stage in ended for recording_id in ids)
            bar.update(task, completed=through)

        flow.drain(count)
        count()


def _row(path: Path, outcome: Outcome, recording: StoredRecording) -> dict[str, object]:
    refused = recording.stage is Stage.REFUSED
    return {
        "file": path.name,
        "known_as": recording.file.file_name,
        "outcome": _REFUSED if refused else _OUTCOMES[outcome],
        "stage": recording.stage.value,
        "hanger": recording.hanger,
        "sha256": recording.file.sha256,
        "reason": _sentence(recording.reason) if recording.reason else None,
    }


_REFUSED = "refused"


def _sentence(reason: Mapping[str, Any]) -> str:
    """Line and channel where they are known, what is wrong, what to do."""
    line = f"line {reason['line']}: " if reason["line"] is not None else ""
    channel = f"channel {reason['channel']}: " if reason["channel"] else ""
    return f"{line}{channel}{reason['message']} {reason['remedy']}"


_OUTCOMES = {
    Outcome.NEW: "taken in",
    Outcome.RESUMED: "taken in",
    Outcome.DUPLICATE: "known already",
    Outcome.REOPENED: "tried again",
}


def _show(rows: Sequence[dict[str, object]], raised: Sequence[Alert], as_json: bool) -> None:
    if as_json:
        show({"files": list(rows), "alerts": [alert_document(alert) for alert in raised]})
        return
    made = table("ingested", "file", "outcome", "hanger", "stage")
    for row in rows:
        values = (row.get(key) for key in ("outcome", "hanger", "stage"))
        made.add_row(str(row["file"]), *("" if value is None else str(value) for value in values))
    show_table(made)
    for row in rows:
        if row["reason"]:
            click.echo(f"{row['file']}: {row['reason']}", err=True)
    for alert in raised:
        click.echo(f"Alert: {alert.message}", err=True)
