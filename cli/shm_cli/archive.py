"""`shm archive`: takes old raw files out of the archive once copies of them lie elsewhere."""

from __future__ import annotations

from datetime import timedelta

import rich_click as click

from shm.pipeline import utc_now
from shm.store.recordings import find_recording
from shm.store.retention import fetch, removable, remove
from shm_cli import flags
from shm_cli.common import answer, opened_store, progress_bar

_DAYS = click.IntRange(1, 36500)  # technical: a century, which dates can bear


@click.group()
def command() -> None:
    """Limit the size of the archive.

    \b
    Example: shm archive fetch t7
    """


@command.command()
@click.option(
    "--keep-days", type=_DAYS, metavar="N", required=True, help="Raw files younger than that stay."
)
@click.option("--dry-run", is_flag=True, help="Only say what would go.")
@flags.json
def prune(keep_days: int, dry_run: bool) -> None:
    """Remove old raw files that have a copy elsewhere; all results stay.

    A raw file is removed only if its recording is done and a copy recorded by
    `shm db backup --archive DIR` exists with the same SHA-256. A file without a copy stays.

    \b
    Example: shm archive prune --keep-days 400 --dry-run
    """
    with opened_store() as (workspace, store):
        with progress_bar() as tell:
            before = utc_now() - timedelta(days=keep_days)
            found = removable(store, workspace.archive, before, tell)
        freed = found.size_bytes
        if not dry_run:
            freed = remove(store, workspace.archive, found.removals, utc_now())
    files = [removal.recording.file.file_name for removal in found.removals]
    verb = "would be removed, which would free" if dry_run else "removed, which freed"
    lines = [f"archive: {len(files)} files {verb} {freed / 1e6:.1f} MB."]
    lines += [f"  {count} old ones stay: {reason}." for reason, count in found.retained.items()]
    pruned = {"files": files, "freed_bytes": freed, "kept": dict(found.retained)}
    answer({"dry_run": dry_run, "archive": pruned}, "\n".join(lines))


@command.command("fetch")
@click.argument("which", metavar="ID")
@flags.json
def fetch_command(which: str) -> None:
    """Fetch the raw file of a recording (by number) or test (by name) from its copy.

    \b
    Example: shm archive fetch t7
    """
    with opened_store() as (workspace, store):
        recording = store.recordings.get(find_recording(store, which)[0])
        held = workspace.archive.holds_whole(recording.file)
        folder = None if held else fetch(store, workspace.archive, recording)
    file, come_from = recording.file.file_name, None if folder is None else str(folder)
    where = "in the archive" if held else f"back in the archive, from {folder}"
    answer({"recording": recording.id, "file": file, "from": come_from}, f"{file} is {where}.")
