"""`shm db`: the store's schema, its soundness, backups of it, and copies into another store."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import rich_click as click

from shm.errors import BadInput, StoreError, UsageError, sentence
from shm.store import Archive, Store, Workspace
from shm.store.backups import (
    CheckedArchive,
    TableContent,
    archived_names,
    back_up,
    check_archive,
    check_store,
    copy_store,
    of_no_recording,
    restore,
    unknown_files,
)
from shm.store.retention import CopiedArchive, copy_archive
from shm.store.upkeep import list_removed_names
from shm_cli import flags
from shm_cli.common import (
    answer,
    counting_bar,
    open_workspace,
    paragraph,
    progress_bar,
    show,
    show_rows,
    waiting,
)
from shm_cli.services import print_unit, print_unit_option

_copies_option = click.option(
    "--archive",
    "copies",
    type=flags.FOLDER,
    metavar="DIR",
    help="A folder for copies of the raw files.",
)


_SQLITE_HEADER = b"SQLite format 3\0"  # https://www.sqlite.org/fileformat.html


@click.group()
def command() -> None:
    """Upgrade, check, back up, restore or copy the store.

    \b
    Example: shm db upgrade
    """


@command.command()
@flags.json
def upgrade() -> None:
    """Upgrade the store to the schema of this version; make its tables on a new server.

    Then what the reports show of older tests is summed up once more, hanger by hanger. That may be
    stopped and begun again.

    \b
    Example: shm --workspace arch db upgrade
    """
    workspace = open_workspace()
    with workspace.lock():
        with waiting("upgrading the store"):
            Store.upgrade(workspace.location)
        with workspace.store() as store, counting_bar() as bar:
            hangers = bar.track(workspace.bridge.bars, description="summing up hangers")
            made = sum(store.posteriors.save_summaries(hanger) for hanger in hangers)
            location = store.location
    answer(
        {"store": location, "upgraded": True, "summed_up": made},
        "The store has the present schema.",
    )


@command.command()
@click.option("--archive", "with_archive", is_flag=True, help="Read the raw files too.")
@flags.json
def check(with_archive: bool) -> None:
    """Check the complete store; exit code 5 on any fault.

    With --archive, each raw file must be there with the SHA-256 that it is named by. Two stores
    with the same rows and checksums hold the same.

    \b
    Example: shm db check --archive
    """
    workspace = open_workspace()
    with workspace.store() as store, progress_bar() as tell:
        checked, location = check_store(store, tell), store.location
        archive = check_archive(store, workspace.archive, tell) if with_archive else None
    findings = (*checked.findings, *(archive.findings if archive else ()))
    if flags.wants_json():
        document = {
            "store": location,
            "tables": [asdict(each) for each in checked.tables],
            "archive": asdict(archive) if archive else None,
            "troubles": [*checked.troubles, *(archive.troubles if archive else ())],
            "findings": [asdict(each) for each in findings],
        }
        show(document)
    else:
        _show_tables(checked.tables)
        held = next(each.rows for each in checked.tables if each.table == "recordings")
        click.echo(f"The store has the present schema and holds {held} recordings.")
        if archive is not None:
            click.echo(_archive_words(archive))
    if findings:
        kinds = Counter(each.kind for each in findings)
        counted = ", ".join(_counted(count, kind) for kind, count in kinds.items())
        _raise_lines(
            f"{_counted(len(findings), 'finding')}: {counted}. What nothing makes again is "
            "restored, store or raw files, from a backup.",
            findings,
        )


@command.command()
@click.argument("target", metavar="FILE|FOLDER", type=click.Path(path_type=Path))
@_copies_option
@print_unit_option
@click.option(
    "--print-timer", "as_timer", is_flag=True, help="Only print a timer that begins it each night."
)
@flags.json
def backup(
    target: Path,
    copies: Path | None,
    as_unit: bool,
    as_timer: bool,
) -> None:
    """Back up the store into a new file, while the daemon runs.

    The file is a SQLite store, of a store in PostgreSQL too. In a FOLDER that is there it becomes
    TIME/shm.db, beside copies of bridge.toml and loggers/. With --archive the raw files that are
    not in DIR yet are copied there, and the store notes which recordings have a copy: only their
    raw files may ever be deleted here.

    \b
    Example: shm db backup /backup/arch-2026-05-01.db --archive /backup/archive
    """
    workspace = open_workspace()
    if as_unit or as_timer:
        _print_backup_unit(workspace.folder, target, copies, as_timer)
        return
    file = target
    if target.is_dir():
        file = target / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}" / "shm.db"
    copied, noted = None, 0
    with workspace.store() as store, progress_bar() as tell:
        written = back_up(store, file, tell)
        if target.is_dir():
            workspace.copy_description(file.parent)
        if copies is not None:
            copied_to, removed = Archive(copies), list_removed_names(store, workspace.archive)
            names = [name for name in archived_names(store) if name not in removed]
            copied = copy_archive(workspace.archive, copied_to, names, tell)
            noted = store.upkeep.note_copies(copied_to, datetime.now(UTC))
        store.upkeep.note_backup(file.resolve(), datetime.now(UTC))
    if flags.wants_json():
        document = {"file": str(file), **_document(written.tables, copied), "newly_noted": noted}
        show({**document, "troubles": list(written.troubles)})
    else:
        _show_tables(written.tables)
        click.echo(f"Wrote {file}.")
        _say_copied(copied)
    _raise_troubles(
        (*written.troubles, *(copied.troubles if copied else ())),
        "The backup holds all else. Keep the older ones, and run `shm db check --archive`.",
    )


def _print_backup_unit(workspace: Path, target: Path, copies: Path | None, timer: bool) -> None:
    folder = target.resolve()
    if not folder.is_dir():
        raise UsageError(
            f"{target} is no folder: each night's backup needs a name of its own.",
            remedy="Make a folder that belongs to the owner of the workspace, and give that.",
        )
    words = ["db", "backup", str(folder)]
    writes = [folder]
    if copies is not None:
        words += ["--archive", str(copies.resolve())]
        writes += [] if copies.resolve().is_relative_to(folder) else [copies.resolve()]
    print_unit("shm-backup.timer" if timer else "shm-backup.service", workspace, words, *writes)


@command.command("restore")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--replace", is_flag=True, help="Even where the store holds something; that is kept beside."
)
@_copies_option
@flags.json
def restore_command(file: Path, replace: bool, copies: Path | None) -> None:
    """Restore a backup into an empty store; --replace keeps the former contents as a file.

    No daemon may be active. A backup of an older schema is brought to the present one. With
    --archive the raw files that are missing here are copied back from DIR.

    \b
    Example: shm db restore /backup/arch-2026-05-01.db --replace
    """
    _refuse_no_backup(file)
    workspace = open_workspace()
    keep_as = workspace.folder / f"shm-before-restore-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.db"
    with workspace.lock(), progress_bar() as tell:
        restored = restore(workspace.location, file, keep_as, tell, replace=replace)
        copied = _fetch(workspace, copies)
    if flags.wants_json():
        previous = str(restored.former) if restored.former else None
        show({"kept": previous, **_document(restored.tables, copied)})
    else:
        _show_tables(restored.tables)
        previous_words = f" What it held before is in {restored.former}." if restored.former else ""
        click.echo(f"The store holds what {file} holds.{previous_words}")
        with workspace.store() as store:
            _say_unknown(unknown_files(store, workspace.archive))
        _say_copied(copied)
    _raise_troubles(copied.troubles if copied else (), "Fetch them from another copy.")


@command.command()
@click.option("--to", "target", required=True, metavar="URL", help="A PostgreSQL URL, or a file.")
@flags.json
def copy(target: str) -> None:
    """Copy the store into an empty one of either kind, and compare rows and checksums.

    Then name that one in SHM_STORE and put shm.db away. A password is better given by PGPASSWORD or
    ~/.pgpass than in the URL.

    \b
    Example: shm db copy --to postgresql://shm@db.example.org/arch
    """
    workspace = open_workspace()
    place = target if "://" in target else Path(target).resolve()
    with workspace.lock(), workspace.store() as store, progress_bar() as tell:
        tables = copy_store(store, place, tell)
    if flags.wants_json():
        show(_document(tables, None))
    else:
        _show_tables(tables)
        click.echo("Both stores hold the same. Name the new one in SHM_STORE.")


def _refuse_no_backup(file: Path) -> None:
    """Raise BadInput if a file cannot be a backup; one that is not there is reported later."""
    if file.is_file():
        with file.open("rb") as opened:
            if opened.read(len(_SQLITE_HEADER)) != _SQLITE_HEADER:
                raise BadInput(
                    "this is not a backup: it is not an SQLite database.",
                    file=file,
                    remedy="Give a file that `shm db backup` has written.",
                )


def _fetch(workspace: Workspace, copies: Path | None) -> CopiedArchive | None:
    if copies is None:
        return None
    with workspace.store() as store, progress_bar() as tell:
        return copy_archive(Archive(copies), workspace.archive, archived_names(store), tell)


def _document(tables: Sequence[TableContent], copied: CopiedArchive | None) -> dict[str, object]:
    return {
        "tables": [asdict(each) for each in tables],
        "archive": asdict(copied) if copied else None,
    }


def _show_tables(tables: Sequence[TableContent]) -> None:
    rows = [(each.table, str(each.rows), each.checksum[:16]) for each in tables]
    show_rows("store", ("table", "rows", "checksum"), rows)


def _say_copied(copied: CopiedArchive | None) -> None:
    if copied is not None:
        click.echo(f"Raw files: {copied.copied} copied, {copied.present} were there already.")


def _say_unknown(names: Sequence[str]) -> None:
    if names:
        what, remedy = of_no_recording(names)
        click.echo(paragraph(f"Raw files: {what}. {remedy}"), err=True)


def _archive_words(archive: CheckedArchive) -> str:
    return (
        f"Raw files: {archive.whole} whole, {len(archive.missing)} missing, "
        f"{len(archive.damaged)} damaged, {len(archive.unreferenced)} of no recording, "
        f"{archive.removed} removed by `shm archive prune`."
    )


def _raise_troubles(troubles: Sequence[str], remedy: str) -> None:
    if troubles:
        _raise_lines(f"{_counted(len(troubles), 'finding')}. {remedy}", map(sentence, troubles))


def _raise_lines(summary: str, findings: Iterable[object]) -> None:
    """Raise an error with its summary, and one finding a line: for the eye, and for grep."""
    raise StoreError("\n".join((summary, *map(str, findings))))


def _counted(count: int, what: str) -> str:
    """Return `1 damaged row`, `3 faults of the file`."""
    if count == 1:
        return f"1 {what}"
    head, of, rest = what.partition(" of ")
    return f"{count} {head}s{of}{rest}"
