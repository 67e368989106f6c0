"""`shm ingest`: files through the same path as the daemon's, or a look into them."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rich_click as click

from shm.documents import alert_document
from shm.errors import BadInput, ShmError, StoreError, UsageError
from shm.pipeline import Flow
from shm.read import bundle
from shm.store import AGAIN_FROM, Outcome, Receipt, Stage, StoredRecording, Workspace
from shm.values import Alert
from shm_cli.again import rerun_document, send_back
from shm_cli.common import json_option, open_workspace, show, show_table, table
from shm_cli.peek import show_peeks
from shm_cli.working import finish, working


@click.command()
@click.argument(
    "files",
    nargs=-1,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE...",
)
@click.option(
    "--together", is_flag=True, help="The files are one test: hits, or set-ups; kept as one .zip."
)
@click.option("--peek", "look", is_flag=True, help="Only show what is in the files.")
@click.option(
    "--again",
    metavar="ID",
    help="Instead of files: do a recording (by number) or a test (by name) again.",
)
@click.option(
    "--from",
    "stage",
    type=click.Choice([stage.value for stage in AGAIN_FROM]),
    help="With --again: the first stage that is done again.  [default: identified]",
)
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[Path, ...],
    together: bool,
    look: bool,
    again: str | None,
    stage: str | None,
    as_json: bool,
) -> int:
    """Take recordings in, look into them with --peek, or do one again with --again.

    Each file is archived, identified, updated and watched as the daemon would; it may also be a
    *.modes.json. The files stay where they are. Exit code 3 when any was refused.

    \b
    Example: shm ingest hanger3_*.csv
    Example: shm ingest --again t7 --from updated
    """
    _refuse_mixture(files, again, stage, together or look)
    if look:
        return show_peeks(files, as_json)
    logging.getLogger("shm").addHandler(logging.NullHandler())  # all is said in the table
    workspace = open_workspace(ctx)
    if again is not None:
        return _again(workspace, again, Stage(stage or Stage.IDENTIFIED), as_json)
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


def _refuse_mixture(
    files: Sequence[Path], again: str | None, stage: str | None, about_files: bool
) -> None:
    if again is None and not files:
        raise UsageError("no file is named.", remedy="Give FILE..., or --again ID.")
    if again is None and stage is not None:
        raise UsageError("--from goes with --again.", remedy="Give --again ID as well.")
    if again is not None and (files or about_files):
        raise UsageError("--again takes no files.", remedy="Give either FILE... or --again ID.")


def _again(workspace: Workspace, which: str, stage: Stage, as_json: bool) -> int:
    with workspace.store() as store:
        known = {stored.id for stored in store.alerts()}
        rerun = send_back(workspace, which, stage)
        recording = store.recording(rerun.recording.id)
        row = _row(Path(recording.file.file_name), Outcome.REOPENED, recording)
        raised = [stored.alert for stored in store.alerts() if stored.id not in known]
    _show([row], raised, as_json, again=rerun_document(rerun, stage))
    return BadInput.exit_code if row["outcome"] == _REFUSED else 0


def _ingest(
    workspace: Workspace, files: Sequence[Path]
) -> tuple[dict[Path, Receipt], list[dict[str, object]]]:
    """Receipts of the files that could be taken in, rows of those that could not."""
    with working(workspace) as flow:
        receipts, unreadable = _received(flow, files)
        finish(flow, [receipt.recording.id for receipt in receipts.values()])
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


def _show(
    rows: Sequence[dict[str, object]], raised: Sequence[Alert], as_json: bool, **more: object
) -> None:
    if as_json:
        alerts = [alert_document(alert) for alert in raised]
        show({"files": list(rows), "alerts": alerts, **more})
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
