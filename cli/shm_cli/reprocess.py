"""`shm ingest --again ID`: a recording, or a test of it, is done anew from a stage on."""

from __future__ import annotations

from typing import Any

import rich_click as click

from shm.errors import NothingThere, StoreBusy
from shm.pipeline import utc_now
from shm.pipeline.jobs import rebuild
from shm.store import Rerun, Stage, Store, Workspace
from shm_cli.working import LEFT_TO_IT, finish, working


def send_back(workspace: Workspace, which: str, stage: Stage) -> Rerun:
    """Supersedes what was made of it and does it again, or leaves that to the daemon at work.

    `which` is a recording's number or a test's name. Raises NothingThere, UsageError; then nothing
    is superseded.
    """
    with workspace.store() as store:
        recording_id, test = store.recordings.find(which)
        if stage is Stage.IDENTIFIED or store.upkeep.damaged_tests(recording_id):
            _refuse_without_raw_file(workspace, store, recording_id)
        for made in rebuild(workspace, store, recording_id, utc_now()):
            click.echo(made, err=True)
        rerun = store.recordings.reprocess(recording_id, stage, utc_now(), test)
    for sentence in sentences(rerun, stage):
        click.echo(sentence, err=True)
    try:
        with working(workspace) as flow:
            finish(flow, [recording_id])
    except StoreBusy:
        click.echo(LEFT_TO_IT, err=True)
    return rerun


def _refuse_without_raw_file(workspace: Workspace, store: Store, recording_id: int) -> None:
    """Raises NothingThere, saying where the raw file lies, where it is not in the archive.

    And StoreError where it is damaged there: nothing is superseded for want of it.
    """
    file = store.recordings.get(recording_id).file
    if workspace.archive.holds(file):
        return workspace.archive.refuse_damaged(file)
    folder = store.upkeep.removed_to().get(recording_id)
    lies = f"; a copy lies in {folder}" if folder else ""
    raise NothingThere(
        f"the raw file {file.file_name} is no longer in the archive{lies}.",
        remedy=f"Run `shm archive fetch {recording_id}` first, or drop the file again.",
    )


def sentences(rerun: Rerun, stage: Stage) -> list[str]:
    """What is done anew, what that supersedes, and what it leaves as it is."""
    names, file = ", ".join(rerun.tests) or "no test yet", rerun.recording.file.file_name
    tests = f"tests: {len(rerun.tests)}, " if stage is Stage.IDENTIFIED else ""
    said = [
        f"{file} ({names}) is to be {stage} again. Superseded, and kept with their lineage: "
        f"{tests}posteriors: {rerun.posteriors}, watches: {rerun.watches}."
    ]
    if rerun.of_baseline:
        own = ", ".join(rerun.of_baseline)
        said.append(
            f"The baseline was made from {own} and stays as it was made; {own} is not compared "
            "with it. To compare with the new result: `shm drift rebaseline`."
        )
    if rerun.recording.hanger is not None:
        said.append("What was said of later tests stays; alerts that were raised stay raised.")
    return said


def rerun_document(rerun: Rerun, stage: Stage) -> dict[str, Any]:
    """The same for programs."""
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
