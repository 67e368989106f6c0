"""The systemd units that commands print of themselves, with paths and user of an installation."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import rich_click as click

from shm.errors import UsageError
from shm.resources import unit_file

_HOMES = (Path("/home"), Path("/root"), Path("/run/user"))
_PLAIN = re.compile(r"[A-Za-z0-9_./:@+,=-]+")

print_unit_option = click.option(
    "--print-unit",
    "as_unit",
    is_flag=True,
    help="Only print a systemd unit that begins it with the other options given here.",
)


def print_unit(name: str, workspace: Path, words: Sequence[str], *writes: Path) -> None:
    """Prints the unit `name` of the shm that runs here: see `unit_text`."""
    click.echo(unit_text(name, workspace, Path(sys.prefix), words, *writes), nl=False)


def serving_words(host: str, port: int, files: Mapping[str, Path | None]) -> Sequence[str]:
    """Where the web interface listens, as options with paths that hold from everywhere."""
    given = [str(word) for name, file in files.items() if file for word in (name, file.resolve())]
    return ["--host", host, "--port", str(port), *given]


def unit_text(name: str, workspace: Path, prefix: Path, words: Sequence[str], *writes: Path) -> str:
    """The unit `name` for a workspace, with the shm installed under `prefix`.

    It calls `shm` with `words` as the owner of the workspace, and may write to the workspace and
    to `writes`. Raises UsageError where a path or a word holds what a unit would have to quote.
    """
    folder, room = str(workspace), [str(workspace), *map(str, writes)]
    _refuse_odd((*room, str(prefix), *words))
    values = {
        "ExecStart": " ".join(["/usr/bin/env", "shm", *words]),
        "Environment=PATH": f"{prefix}/bin:/usr/local/bin:/usr/bin:/bin",
        "Environment=SHM_WORKSPACE": folder,
        "WorkingDirectory": folder,
        "ReadWritePaths": " ".join(room),
        "User": workspace.owner(),
    }
    if any(map(_is_in_a_home, (workspace, prefix, *writes))):
        values["ProtectHome"] = "read-only"  # hidden homes would hide what it works with
    text = unit_file(name).read_text(encoding="utf-8")
    for key, value in values.items():
        line = re.compile(rf"^{re.escape(key)}=.*$", re.MULTILINE)
        text = line.sub(lambda _, key=key, value=value: f"{key}={value}", text, count=1)  # type: ignore[misc]
    return text


def _is_in_a_home(path: Path) -> bool:
    return any(path.resolve().is_relative_to(home) for home in _HOMES)


def _refuse_odd(texts: Sequence[str]) -> None:
    for text in texts:
        if not _PLAIN.fullmatch(text):
            raise UsageError(
                f"{text!r} would have to be quoted in a unit.",
                remedy="Use paths without spaces, or write it by hand from config/shm.service.",
            )
