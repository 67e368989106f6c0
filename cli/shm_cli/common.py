"""Printing, progress and input that verbs share."""

from __future__ import annotations

import getpass
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import rich_click as click
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from shm.bridge import load_hanger
from shm.documents import dump
from shm.errors import UsageError
from shm.modes_document import load_modes
from shm.values import Hanger, ModalTest
from shm_cli import errors
from shm_cli.flags import wants_json
from shm_cli.terminal import Terminal, escape_controls

if TYPE_CHECKING:
    from shm.report.figures.specification import Illustration
    from shm.report.paper import Table as Texts
    from shm.store import Store, Workspace

# Technical: columns of a file, and of lines that are read with ease.
_WIDTH_OF_A_FILE = 120
_READABLE = 100


def show(document: Mapping[str, object], kind: str = "") -> None:
    """Print one JSON document on stdout, with its schema first.

    A document without `schema` gets `shm.KIND/1`; KIND is by default the command, as in
    `shm.alerts_silences/1`.
    """
    context = click.get_current_context()
    assert context is not None
    command = "_".join(context.command_path.split()[1:])
    schema = document.get("schema", f"shm.{kind or command}/1")
    errors.printed_documents.append(str(schema))
    click.echo(dump({"schema": schema, **document}))


def answer(document: Mapping[str, object], words: str, kind: str = "") -> None:
    """Print one JSON document on stdout where --json asks for it, else words for a person."""
    if wants_json():
        show(document, kind)
    else:
        click.echo(words)


def can_ask() -> bool:
    """Return True if a person at a terminal can be asked; with --json nothing is."""
    return not wants_json() and sys.stdin.isatty() and sys.stdout.isatty()


def show_rows(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print rows of texts as a table that fits the terminal; in a file no column is narrow."""
    from shm.report.as_text import laid_out
    from shm.report.paper import Table

    width = shutil.get_terminal_size((_WIDTH_OF_A_FILE, 24)).columns
    # Before click leaves out what would colour a terminal, and as wide as it is then.
    escaped = tuple(tuple(escape_controls(cell) for cell in row) for row in rows)
    made = Table("", tuple(headings), escaped)
    if title:
        click.echo(title)
    click.echo(laid_out(made, width).strip("\n") + "\n")


def markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    head, *others = [f"| {' | '.join(line)} |" for line in (heads, *rows)]
    return "\n".join([head, "|" + "---|" * len(heads), *others])


def show_texts(texts: Texts) -> None:
    """Print a table of a report, and its note."""
    from shm.report.as_text import in_terminal

    shown = in_terminal(texts)
    show_rows(shown.title, shown.headings, shown.rows)
    if shown.note:
        click.echo(paragraph(shown.note))


def readable_width() -> int:
    """Return the columns of the terminal, limited to a readable width; for files, too."""
    return min(_READABLE, shutil.get_terminal_size((_READABLE, 24)).columns)


def paragraph(text: str) -> str:
    """Return a text in lines that fit the terminal, and are not too long to read."""
    return textwrap.fill(text, readable_width())


def workspace_folder() -> str:
    """Return the folder of the running command."""
    context = click.get_current_context()
    assert context is not None
    return str(context.obj)


def open_workspace(**flags: object) -> Workspace:
    """Return the workspace of the command; `flags` are settings given on the command line."""
    from shm.store import Workspace
    from shm.store.journal import COMMAND_LINE, Actor

    opened = Workspace.open(workspace_folder(), flags)
    return replace(opened, actor=Actor(getpass.getuser(), COMMAND_LINE))


def is_workspace() -> bool:
    """Return True if the folder of the command is a workspace."""
    return (Path(workspace_folder()) / "bridge.toml").is_file()


@contextmanager
def opened_store() -> Iterator[tuple[Workspace, Store]]:
    """Return the workspace of the command and its store, open."""
    workspace = open_workspace()
    with readable_store(workspace) as store:
        yield workspace, store


@contextmanager
def readable_store(workspace: Workspace) -> Iterator[Store]:
    """Return the open store; on a full disk a copy to read, which is said first."""
    with workspace.store(or_copy=True) as store:
        if store.copied:
            text = f"Nothing can be written: {store.copied} What follows is read from a copy."
            click.echo(paragraph(text), err=True)
        yield store


def one_hanger(hanger_file: Path | None, hanger_id: int | None) -> Hanger:
    """Return the hanger that the options name; raises UsageError where they name none."""
    if hanger_file is not None:
        return load_hanger(hanger_file, hanger_id)
    if hanger_id is None:
        raise UsageError("which hanger?", remedy="Give --hanger N, or --hanger-file H.toml.")
    return open_workspace().bridge.hanger(hanger_id)


def tests_and_hanger(
    modes_file: Path | None, hanger_file: Path | None, hanger_id: int | None
) -> tuple[tuple[ModalTest, ...], Hanger]:
    """Return tests of a MODES.json with their hanger, or the latest of the workspace."""
    if modes_file is not None:
        tests = load_modes(modes_file)
        if hanger_id is None and hanger_file is None:
            hanger_id = tests[0].hanger
        hanger = one_hanger(hanger_file, hanger_id)
        return tests, hanger
    from shm.pipeline.diagnosing import latest_tests

    hanger = one_hanger(hanger_file, hanger_id)
    with opened_store() as (_, store):
        return (latest_tests(store, hanger, 1)[0].test,), hanger


def show_doubts(
    tests: Sequence[ModalTest], hanger: Hanger, *, apart: bool = True
) -> tuple[str, ...]:
    """Print, before any result, which tests are probably not of the described hanger.

    On stderr, or with the answer unless they are `apart` from it.
    """
    from shm.plausibility.bars import Known, doubt_of

    others = tuple(
        f"Doubtful: test {test.id}. It says that it is of hanger {test.hanger}, the description is "
        f"of hanger {hanger.id}: right file?"
        for test in tests
        if test.hanger not in (None, hanger.id)
    )
    doubts = {test.id: doubt_of(test, Known(hanger), []) for test in tests}
    found = tuple(f"Doubtful: test {id_}. {doubt.text}" for id_, doubt in doubts.items() if doubt)
    messages = (*others, *found)
    for each in messages:
        click.echo(each if apart else paragraph(each), err=apart)
    return messages


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Yield a bar on stderr for a job of many steps; takes the step and the total fraction.

    Where one step after another runs from 0 to 1, the bar does so again.
    """
    with _bar(TextColumn("{task.percentage:>3.0f} %")) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda label, fraction: bar.update(
            task, description=label.replace("_", " "), completed=fraction
        )


def counting_bar() -> Progress:
    """Return a bar on stderr that counts things done."""
    return _bar(MofNCompleteColumn())


def _bar(done: ProgressColumn) -> Progress:
    console = Terminal(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        done,
        TextColumn("time left"),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )


@contextmanager
def waiting(label: str) -> Iterator[None]:
    """Show a spinner and the elapsed time on stderr, where the remaining time is unknown."""
    console = Terminal(stderr=True)
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as sign:
        sign.add_task(label, total=None)
        yield


def write_pictures(drawn: Iterable[Illustration], folder: Path, start: str = "") -> None:
    """Write each figure as a PNG into the folder, under its name after `start`."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in drawn:
        (folder / f"{start}{each.name}.png").write_bytes(each.png())


def drawing() -> AbstractContextManager[None]:
    """Show that figures and pages are being written."""
    return waiting("drawing the figures")
