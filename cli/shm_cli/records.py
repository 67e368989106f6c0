"""`shm note` and `shm audit`: what people saw and did, and what they changed."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import rich_click as click

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store.journal import change_document, list_changes
from shm.values.notes import NoteKind
from shm_cli import flags
from shm_cli.common import answer, opened_store, show_rows


@click.group()
def note() -> None:
    """Record notes, inspections and repairs of a hanger.

    \b
    Example: shm note list --hanger 3
    """


@note.command()
@click.argument("text", type=flags.Words())
@flags.hanger()
@click.option("--bridge", "whole", is_flag=True, help="Of the whole bridge.")
@click.option(
    "--kind",
    type=click.Choice([each.value for each in NoteKind]),
    default=NoteKind.NOTE.value,
    help="What it was.",
)
@click.option("--at", type=flags.Time(), show_default="now", help="When it was seen or done.")
@click.option(
    "--photo",
    type=flags.FILE,
    metavar="FILE",
    help="A JPEG or PNG of 5 MB at most; the picture alone is kept.",
)
@flags.who
@flags.json
def add(
    text: str,
    hanger_id: int | None,
    whole: bool,
    kind: str,
    at: datetime | None,
    photo: Path | None,
    who: str,
) -> None:
    """Write a permanent note; a later one can correct it.

    \b
    Example: shm note add "new pin, lower end" --hanger 3 --kind repair --at 2026-05-01
    """
    if whole == (hanger_id is not None):
        raise UsageError("a note of what?", remedy="Give --hanger N or --bridge.")
    now = utc_now()
    with opened_store() as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.tested(hanger_id)
        image = photo.read_bytes() if photo else b""
        made = store.notes.add(hanger_id, at or now, NoteKind(kind), text, who, now, image)
    answer(vars(made), f"Note {made.id} of {made.of} is kept.")


@note.command("list")
@flags.hanger()
@flags.json
def list_notes(hanger_id: int | None) -> None:
    """List notes on a hanger and on the bridge, or all notes, the latest first.

    \b
    Example: shm note list --hanger 3 --json
    """
    with opened_store() as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.tested(hanger_id)
        found = store.notes.list_all(hanger_id)
    if flags.wants_json() or not found:
        answer({"notes": [vars(each) for each in found]}, "No note was written.")
        return
    rows = [
        (
            f"{each.at:%Y-%m-%d}", each.kind, each.of, each.who, "yes" if each.has_photo else "",
            each.text,
        )
        for each in found
    ]  # fmt: skip
    show_rows("notes", ("date", "kind", "of", "by", "photo", "text"), rows)


@click.command()
@click.option("--limit", type=click.IntRange(min=1), help="So many of the newest.")
@flags.json
def audit(limit: int | None) -> None:
    """Show who changed what, and when.

    What shm does by itself is not listed, nor what is edited in bridge.toml.

    \b
    Example: shm audit --limit 20
    """
    with opened_store() as (_, store):
        rows = [change_document(each) for each in list_changes(store, limit)]
    if flags.wants_json() or not rows:
        answer({"changes": rows}, "Nothing was changed.")
        return
    cells = [(f"{each['at']:%Y-%m-%d %H:%M}", *list(each.values())[2:]) for each in rows]
    show_rows("changes", ("time", "who", "by", "action", "of", "detail"), cells)
