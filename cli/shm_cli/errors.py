"""Errors of a command as JSON documents, and a suggestion for a misspelt value.

    {"schema": "shm.error/1", "error": "nothing_there", "message": "no alert 99.",
     "remedy": "See `shm alerts`.", "exit_code": 4}

`error` is one of KINDS, or UNEXPECTED; `file`, `channel` and `line` are added where they are known.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field

import rich_click as click

from shm.errors import BadInput, ShmError, suggest

SCHEMA = "shm.error/1"
KINDS = {
    1: "failed",
    2: "usage",
    3: "bad_input",
    4: "nothing_there",
    5: "store",
    6: "gate_not_met",
}
"""By exit code; an error that shm did not foresee has the exit code 1, too."""
UNEXPECTED = "unexpected"

printed_documents: list[str] = []
"""The schemas of the documents that the running command has printed on stdout."""


@dataclass(frozen=True)
class Failure:
    """An error that ended a command."""

    exit_code: int
    kind: str
    message: str
    remedy: str
    place: dict[str, object] = field(default_factory=dict)

    def document(self) -> str:
        """Return the error as JSON text."""
        about = {"error": self.kind, "message": self.message}
        document = {"schema": SCHEMA, **about, "remedy": self.remedy, **self.place}
        return json.dumps({**document, "exit_code": self.exit_code}, indent=2)


def of_shm(error: ShmError) -> Failure:
    """Return an error that shm raises on purpose."""
    place: dict[str, object] = {}
    if isinstance(error, BadInput):
        known = {"file": error.file, "channel": error.channel, "line": error.line}
        place = {name: value for name, value in known.items() if value not in ("", None)}
    kind = KINDS.get(error.exit_code, KINDS[1])
    return Failure(error.exit_code, kind, error.message, error.remedy, place)


def of_click(error: click.ClickException) -> Failure:
    """Return an error in how the command was typed."""
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "shm"
    kind = KINDS.get(error.exit_code, KINDS[1])
    return Failure(error.exit_code, kind, error.format_message(), f"See `{path} --help`.")


def of_unexpected(error: Exception) -> Failure:
    """Return an error that shm did not foresee."""
    remedy = "This is a fault of shm. `shm --debug ...` shows where; please report it."
    return Failure(1, UNEXPECTED, f"Unexpected {type(error).__name__}: {error}", remedy)


def add_suggestion(error: click.ClickException) -> None:
    """Add the nearest value to the message of an option that takes one of a list.

    Of the options that click suggests for an unknown one, drop those that share only the dashes.
    """
    if isinstance(error, click.NoSuchOption) and error.possibilities:
        name = error.option_name.strip("-")
        vars(error)["possibilities"] = [
            each for each in error.possibilities if suggest(name, [each.strip("-")])
        ]
    chosen = getattr(getattr(error, "param", None), "type", None)
    given = re.match(r"'(.*?)' is not one of", error.message)
    if given and isinstance(chosen, click.Choice):
        nearest = suggest(given[1], map(str, chosen.choices))
        vars(error)["message"] = f"{error.message} {nearest}".rstrip()
