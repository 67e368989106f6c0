"""`shm archive`: takes old raw files out of the archive once copies of them lie elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import rich_click as click

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Store, Workspace
from shm.store.queries.recordings import find_recording
from shm.store.retention import (
    Refused,
    Retention,
    empty_quarantine,
    expendable,
    fetch,
    refused_files,
    removable,
    remove,
)
from shm_cli import flags
from shm_cli.common import answer, opened_store, progress_bar

_DAYS = click.IntRange(1, 36500)  # technical: a century, which dates can bear


@click.group()
def command() -> None:
    """Limit the size of the archive and the quarantine.

    \b
    Example: shm archive fetch t7
    """


@command.command()
@click.option("--keep-days", type=_DAYS, metavar="N", help="Raw files younger than that stay.")
@click.option(
    "--quarantine-days", type=_DAYS, metavar="N", help="Refused files younger than that stay."
)
@click.option("--dry-run", is_flag=True, help="Only say what would go.")
@flags.json
@click.pass_context
def prune(
    ctx: click.Context,
    keep_days: int | None,
    quarantine_days: int | None,
    dry_run: bool,
) -> None:
    """Remove old raw files that have a copy elsewhere; all results stay.

    A raw file is removed only if its recording is done and a copy recorded by
    `shm db backup --archive DIR` exists with the same SHA-256. A refused file is removed from the
    quarantine only if it is also in the archive or in such a copy. A file without a copy stays.

    \b
    Example: shm archive prune --keep-days 400 --dry-run
    """
    if keep_days is None and quarantine_days is None:
        raise UsageError("nothing is to be pruned.", remedy="Give --keep-days N.")
    with opened_store(ctx) as (workspace, store):
        raw = _prune_archive(workspace, store, keep_days, dry_run)
        refused = _prune_quarantine(workspace, store, quarantine_days, dry_run)
    document = {"dry_run": dry_run, "archive": raw.document, "quarantine": refused.document}
    sentences = [*raw.sentences("archive", dry_run), *refused.sentences("quarantine", dry_run)]
    answer(document, "\n".join(sentences))


@command.command("fetch")
@click.argument("which", metavar="ID")
@flags.json
@click.pass_context
def fetch_command(ctx: click.Context, which: str) -> None:
    """Fetch the raw file of a recording (by number) or test (by name) from its copy.

    \b
    Example: shm archive fetch t7
    """
    with opened_store(ctx) as (workspace, store):
        recording = store.recordings.get(find_recording(store, which)[0])
        held = workspace.archive.holds_whole(recording.file)
        folder = None if held else fetch(store, workspace.archive, recording)
    file, come_from = recording.file.file_name, None if folder is None else str(folder)
    where = "in the archive" if held else f"back in the archive, from {folder}"
    answer({"recording": recording.id, "file": file, "from": come_from}, f"{file} is {where}.")


@dataclass(frozen=True)
class _Pruned:
    """Return a sentence on the files removed from a folder, and why other old ones stay."""

    files: Sequence[str]
    freed_bytes: int
    remaining: dict[str, int]

    @property
    def document(self) -> dict[str, Any]:
        return {"files": list(self.files), "freed_bytes": self.freed_bytes, "kept": self.remaining}

    def sentences(self, what: str, dry_run: bool) -> list[str]:
        verb = "would be removed, which would free" if dry_run else "removed, which freed"
        lines = [f"{what}: {len(self.files)} files {verb} {self.freed_bytes / 1e6:.1f} MB."]
        lines += [f"  {count} old ones stay: {reason}." for reason, count in self.remaining.items()]
        return lines


def _prune_archive(
    workspace: Workspace, store: Store, keep_days: int | None, dry_run: bool
) -> _Pruned:
    found = Retention((), {})
    if keep_days is not None:
        with progress_bar() as tell:
            before = utc_now() - timedelta(days=keep_days)
            found = removable(store, workspace.archive, before, tell)
    freed = found.size_bytes
    if not dry_run:
        freed = remove(store, workspace.archive, found.removals, utc_now())
    files = [removal.recording.file.file_name for removal in found.removals]
    return _Pruned(files, freed, dict(found.kept))


def _prune_quarantine(
    workspace: Workspace, store: Store, keep_days: int | None, dry_run: bool
) -> _Pruned:
    old: tuple[Refused, ...] = ()
    if keep_days is not None:
        old = refused_files(workspace.quarantine.folder, utc_now() - timedelta(days=keep_days))
    going = expendable(store, workspace.archive, old)
    if not dry_run:
        empty_quarantine(going)
    names = [file.path.name for file in going]
    left = len(old) - len(going)
    remaining = {"their bytes lie nowhere else": left} if left else {}
    return _Pruned(names, sum(file.size_bytes for file in going), remaining)
