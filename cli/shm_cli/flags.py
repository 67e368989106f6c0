"""The options that verbs share, and what options take: a text that is not empty, a file to write.

Whether a file can be written is checked before the work, not after it.
"""

from __future__ import annotations

import getpass
import os
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import rich_click as click

from shm.documents import parse_time
from shm.errors import BadInput, suggest
from shm.settings import TABLE
from shm_cli import completion

F = TypeVar("F", bound=Callable[..., Any])


FOLDER = click.Path(file_okay=False, path_type=Path)


class Words(click.ParamType[str]):
    """A text with something in it."""

    name = "text"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text without blanks around it; refuse an empty one."""
        if not value.strip():
            self.fail("it is empty. Say it in a few words.", param, ctx)
        return value.strip()


class Time(click.ParamType[datetime]):
    """A day or a time of ISO 8601; one without zone is taken as UTC."""

    name = "time"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> datetime:
        try:
            return parse_time(str(value))
        except (ValueError, OverflowError):
            remedy = "Write a day as 2026-05-01, or a time as 2026-05-01T10:00Z."
            self.fail(f"{value!r} is not an ISO 8601 time. {remedy}", param, ctx)


class ExistingFile(click.Path):
    """A path of a file that exists; the nearest name of its folder is suggested."""

    def __init__(self) -> None:
        super().__init__(exists=True, dir_okay=False, path_type=Path)

    def convert(
        self, value: Any, parameter: click.Parameter | None, context: click.Context | None
    ) -> Any:
        try:
            return super().convert(value, parameter, context)
        except click.BadParameter as error:
            path = Path(os.fsdecode(value))
            if path.exists() or not path.parent.is_dir():
                raise
            nearest = suggest(path.name, (each.name for each in path.parent.iterdir()))
            self.fail(f"{error.message} {nearest}".strip(), parameter, context)


FILE = ExistingFile()


class NewFile(click.Path):
    """A path at which a file can be written, new or in the place of one.

    With an `ending` such as ".png" it has no other.
    """

    def __init__(self, ending: str = "") -> None:
        super().__init__(dir_okay=False, writable=True, path_type=Path)
        self._ending = ending

    def convert(
        self, value: Any, parameter: click.Parameter | None, context: click.Context | None
    ) -> Any:
        path = Path(os.fsdecode(super().convert(value, parameter, context)))
        if self._ending and path.suffix.lower() != self._ending:
            raise BadInput(
                f"{path} is no name of a {self._ending} file.",
                remedy=f"Let it end in {self._ending}: that is what is written.",
            )
        return _writable(path)


class NewFolder(click.Path):
    """A path at which a folder is, or can be made in one that is there."""

    def convert(
        self, value: Any, parameter: click.Parameter | None, context: click.Context | None
    ) -> Any:
        return _writable(Path(os.fsdecode(super().convert(value, parameter, context))))


def _writable(path: Path) -> Path:
    """Return the path; raise BadInput where its folder is not there or takes no files."""
    folder = path.absolute().parent
    if not folder.is_dir():
        raise BadInput(f"{folder} is no folder.", remedy="Make it first, or name another.")
    if not os.access(folder, os.W_OK):
        raise BadInput(f"nothing can be written into {folder}.", remedy="Name another.")
    return path


_JSON = "shm_cli.json"


def _note_json(ctx: click.Context, _: click.Parameter, is_asked: bool) -> None:
    ctx.meta[_JSON] = is_asked


json = click.option(
    "--json", "as_json", is_flag=True, expose_value=False, callback=_note_json,
    help="One JSON document on stdout.",
)  # fmt: skip


def wants_json() -> bool:
    """Return True if the running command was given --json."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(_JSON))


why = click.option("--why", type=Words(), required=True, help="For the record.")
who = click.option(
    "--who",
    callback=lambda *given: given[-1] or getpass.getuser(),
    show_default="the user's name",
    help="For the record.",
)
figures = click.option(
    "--figures",
    type=NewFolder(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Write each figure as a PNG here.",
)
seed = click.option("--seed", type=click.IntRange(min=0), default=1, help="Random seed.")
# Judgement: below 100 no 90 % interval has five draws beyond each end; a million fill the memory.
samples = click.option(
    "--samples",
    type=click.IntRange(100, 1_000_000),
    default=1000,
    help="Posterior samples.",
)

# As in shm.models, which would take a fifth of a second to load.
_PRIORS = next(row.choices for row in TABLE if row.name == "priors")
priors = click.option(
    "--priors",
    type=click.Choice(_PRIORS),
    default=_PRIORS[0],
    help="What is possible before the test: by the hanger's description, or by the thesis.",
)

log_file = click.option(
    "--log-file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the log there, not on stderr; it is put aside as it grows (log_files of them).",
)


def hanger(required: bool = False) -> Callable[[F], F]:
    """Add `--hanger N`: a hanger of the workspace, or one of several in --hanger-file."""
    return click.option(
        "--hanger",
        "hanger_id",
        type=int,
        required=required,
        metavar="N",
        shell_complete=completion.hangers,
        help="Hanger number.",
    )


hanger_file = click.option(
    "--hanger-file", type=FILE, metavar="H.toml", help="A [[hanger]] table, instead of a workspace."
)

baseline = click.option(
    "--baseline",
    metavar="NAME",
    default="",
    show_default="the beam that these data prefer",
    shell_complete=completion.models,
    help="The model class whose gap is diagnosed.",
)
latest = click.option(
    "--tests",
    "count",
    type=click.IntRange(1, 100),
    default=20,
    metavar="N",
    help="How many of the latest tests of a hanger of the workspace.",
)
