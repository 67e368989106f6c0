"""Immediate processing for `shm ingest`, in a separate flow."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import rich_click as click

from shm.errors import NothingThere, StoreBusy
from shm.pipeline import Flow, utc_now
from shm.store import ENDED, Rerun, Stage, Store, Workspace
from shm.store.recordings import find_recording
from shm.store.upkeep import list_removed
from shm_cli.common import counting_bar
from shm_daemon.execution import children_ended, executor_of
from shm_daemon.hooks import HookNotifier


@contextmanager
def working(workspace: Workspace) -> Iterator[Flow]:
    """Return a flow while the context lasts; raises StoreBusy where another process ingests."""
    settings = workspace.settings
    with ExitStack() as stack:
        stack.enter_context(workspace.lock())
        store = stack.enter_context(workspace.store())
        stack.enter_context(children_ended())
        executor = executor_of(settings)
        stack.callback(executor.shutdown, wait=False, cancel_futures=True)
        notifier = HookNotifier(
            workspace.folder,
            settings.hook_timeout_seconds,
            os.environ,
            settings.pages_address,
        )
        stack.callback(notifier.close)
        flow = Flow(workspace, store, executor, notifier=notifier, lanes=settings.workers)
        stack.callback(flow.close)
        yield flow


def finish(flow: Flow, ids: Sequence[int]) -> None:
    """Work until no recording waits, and print how many are done."""
    with counting_bar() as bar:
        task = bar.add_task("ingesting", total=len(ids))

        def count() -> None:
            through = sum(
                flow.store.recordings.get(recording_id).stage in ENDED for recording_id in ids
            )
            bar.update(task, completed=through)

        flow.drain(count)
        while (wait_s := flow.suspects_due_s()) is not None:  # its process died
            time.sleep(wait_s)
            flow.drain(count)
        count()


def finish_now(workspace: Workspace, recording_id: int) -> None:
    """Work until a recording is done, or leave that to the daemon at work."""
    try:
        with working(workspace) as flow:
            finish(flow, [recording_id])
    except StoreBusy:
        click.echo("Noted. The daemon does the rest; see `shm status`.", err=True)


def send_back(workspace: Workspace, which: str, stage: Stage) -> Rerun:
    """Supersede results and recompute them, or leave that to the daemon at work.

    `which` is a recording's number or a test's name. Raises NothingThere, UsageError; then
    nothing is superseded.
    """
    with workspace.store() as store:
        recording_id, test = find_recording(store, which)
        if stage is Stage.IDENTIFIED:
            _refuse_without_raw_file(workspace, store, recording_id)
        rerun = store.recordings.rerun(recording_id, stage, utc_now(), test)
    for sentence in sentences(rerun, stage):
        click.echo(sentence, err=True)
    finish_now(workspace, recording_id)
    return rerun


def _refuse_without_raw_file(workspace: Workspace, store: Store, recording_id: int) -> None:
    """Raise NothingThere, saying where the raw file lies, where it is not in the archive.

    And StoreError where it is damaged there: nothing is superseded for want of it.
    """
    file = store.recordings.get(recording_id).file
    if workspace.archive.holds(file):
        return workspace.archive.refuse_damaged(file)
    folder = list_removed(store).get(recording_id)
    lies = f"; a copy lies in {folder}" if folder else ""
    raise NothingThere(
        f"the raw file {file.file_name} is no longer in the archive{lies}.",
        remedy=f"Run `shm archive fetch {recording_id}` first, or drop the file again.",
    )


def sentences(rerun: Rerun, stage: Stage) -> list[str]:
    """Return sentences on a rerun: what is repeated, replaced and left as it is."""
    names, file = ", ".join(rerun.tests) or "no test yet", rerun.recording.file.file_name
    tests = f"tests: {len(rerun.tests)}, " if stage is Stage.IDENTIFIED else ""
    lines = [
        f"{file} ({names}) is to be {stage} again. Superseded, and kept with their lineage: "
        f"{tests}posteriors: {rerun.posteriors}, watches: {rerun.watches}."
    ]
    if rerun.of_baseline:
        names = ", ".join(rerun.of_baseline)
        lines.append(
            f"The baseline was made from {names} and stays as it was made; {names} is not compared "
            "with it. To compare with the new result: `shm drift rebaseline`."
        )
    if rerun.recording.hanger is not None:
        lines.append("What was said of later tests stays; alerts that were raised stay raised.")
    return lines


def rerun_document(rerun: Rerun, stage: Stage) -> dict[str, Any]:
    """Return the same for programs."""
    return {
        "recording": rerun.recording.id,
        "from": stage.value,
        "tests": list(rerun.tests),
        "of_baseline": list(rerun.of_baseline),
        "superseded": {
            "tests": len(rerun.tests) if stage is Stage.IDENTIFIED else 0,
            "posteriors": rerun.posteriors,
            "watches": rerun.watches,
        },
    }
