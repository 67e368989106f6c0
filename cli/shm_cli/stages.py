"""`shm status --of`: how one recording or test went through, and what became of its results."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import rich_click as click

from shm.store import Decision
from shm_cli import flags
from shm_cli.common import opened_store, paragraph, show, show_rows

if TYPE_CHECKING:
    from shm.store import FormerPosterior, FormerTest

_OUT = (Decision.DISCARDED, Decision.WITHDRAWN)


def show_stages(ctx: click.Context, which: str) -> None:
    """Raises NothingThere where there is no such recording or test."""
    with opened_store(ctx) as (_, store):
        recording_id, _ = store.recordings.find(which)
        recording = store.recordings.get(recording_id)
        steps, tests = (
            store.recordings.list_steps(recording_id),
            store.tests.list_former(recording_id),
        )
        noticed = store.recordings.list_events(recording_id=recording_id)
        other_names = [
            n for n in store.recordings.names_of(recording_id) if n != recording.file.file_name
        ]
    if flags.wants_json():
        show(
            {
                "recording": recording_id,
                "file": recording.file.file_name,
                "also_came_as": other_names,
                "stage": recording.stage.value,
                "steps": [asdict(step) for step in steps],
                "noticed": [
                    {"at": event.at, "kind": event.kind, "message": event.message}
                    for event in noticed
                ],
                "results": [asdict(test) for test in tests],
            }
        )
        return
    also = f" (also came as {', '.join(other_names)})" if other_names else ""
    title = f"recording {recording_id}: {recording.file.file_name}{also}"
    by_a_person = {event.at: event.kind for event in noticed if event.kind in _OUT}
    rows = [
        (by_a_person.get(e.at, e.stage), e.test or "", f"{e.at:%Y-%m-%d %H:%M:%S}", e.version or "")
        for e in steps
    ]
    show_rows(title, ("stage", "test", "at", "shm"), rows)
    for event in noticed:
        if event.message:
            kind = "" if event.message.startswith(event.kind) else f"{event.kind}: "
            said = f"{event.at:%Y-%m-%d %H:%M:%S} {kind}{event.message}"
            click.echo(paragraph(said))
    for test in tests:
        _tell(test)


def _tell(test: FormerTest) -> None:
    click.echo(f"{test.name}: identified by shm {test.lineage.version}{_until(test)}")
    for made in test.posteriors:
        click.echo(f"  posterior of {made.model} by shm {made.lineage.version}{_until(made)}")


def _until(result: FormerTest | FormerPosterior) -> str:
    superseded_at = result.superseded_at
    return f", superseded {superseded_at:%Y-%m-%d %H:%M:%S}" if superseded_at else ""
