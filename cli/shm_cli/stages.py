"""`shm status --of ID`: each stage that a recording has reached, and every result it ever had."""

from __future__ import annotations

from dataclasses import asdict

import rich_click as click

from shm.store import FormerPosterior, FormerTest
from shm_cli.common import opened_store, show, show_table, table


def show_stages(ctx: click.Context, which: str, as_json: bool) -> None:
    """Raises NothingThere where there is no such recording or test."""
    with opened_store(ctx) as (_, store):
        recording_id, _ = store.recording_named(which)
        recording = store.recording(recording_id)
        steps, tests = store.steps(recording_id), store.former_tests(recording_id)
    if as_json:
        show(
            {
                "recording": recording_id,
                "file": recording.file.file_name,
                "stage": recording.stage.value,
                "steps": [asdict(step) for step in steps],
                "results": [asdict(test) for test in tests],
            }
        )
        return
    made = table(f"recording {recording_id}: {recording.file.file_name}", "stage", "test", "at")
    made.add_column("shm", justify="right")
    for step in steps:
        made.add_row(step.stage, step.test or "", f"{step.at:%Y-%m-%d %H:%M:%S}", step.version)
    show_table(made)
    for test in tests:
        _tell(test)


def _tell(test: FormerTest) -> None:
    click.echo(f"{test.name}: identified by shm {test.lineage.version}{_until(test)}")
    for made in test.posteriors:
        click.echo(f"  posterior of {made.model} by shm {made.lineage.version}{_until(made)}")


def _until(result: FormerTest | FormerPosterior) -> str:
    superseded_at = result.superseded_at
    return f", superseded {superseded_at:%Y-%m-%d %H:%M:%S}" if superseded_at else ""
