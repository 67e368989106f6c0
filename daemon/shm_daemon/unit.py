"""The systemd unit of `config/shm.service` with the paths and the user of this installation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from shm.errors import UsageError
from shm.resources import service_unit

_HOMES = (Path("/home"), Path("/root"), Path("/run/user"))
_PLAIN = re.compile(r"[A-Za-z0-9_./:@+,=-]+")


def unit_text(workspace: Path, prefix: Path, options: Sequence[str] = ()) -> str:
    """The unit for a workspace, with the shm installed under `prefix` and options of `shm daemon`;
    it runs as the owner of the workspace.

    Raises UsageError where a path or an option holds what a unit would have to quote.
    """
    folder = str(workspace)
    _refuse_odd((folder, str(prefix), *options))
    values = {
        "ExecStart": " ".join(["/usr/bin/env", "shm", "daemon", *options]),
        "Environment=PATH": f"{prefix}/bin:/usr/local/bin:/usr/bin:/bin",
        "Environment=SHM_WORKSPACE": folder,
        "WorkingDirectory": folder,
        "ReadWritePaths": folder,
        "User": workspace.owner(),
    }
    if _is_in_a_home(workspace) or _is_in_a_home(prefix):
        values["ProtectHome"] = "read-only"  # hidden homes would hide workspace or program
    text = service_unit().read_text(encoding="utf-8")
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
