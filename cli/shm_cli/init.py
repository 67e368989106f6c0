"""`shm init`: makes a workspace."""

from __future__ import annotations

import json
import re
from pathlib import Path

import rich_click as click

from shm.store import Workspace
from shm_cli import flags
from shm_cli.common import answer, workspace_folder


@click.command()
@click.argument("folder", required=False, type=flags.FOLDER)
@click.option(
    "--from",
    "config",
    type=flags.FILE,
    metavar="BRIDGE.toml",
    help="Copy this description instead of the commented one.",
)
@click.option("--bridge", "name", metavar="NAME", help="Name of the bridge.")
@flags.json
def command(folder: Path | None, config: Path | None, name: str | None) -> None:
    """Make a workspace for a bridge.

    It is a folder: bridge.toml (describe your hangers there), shm.db, spool/ (drop recordings
    here), archive/ (raw files, never changed) and quarantine/ (refused files with the reason).

    \b
    Example: shm init arch --bridge "Arch bridge"
    """
    workspace = Workspace.initialise(folder or Path(workspace_folder()), config)
    if name is not None:
        _rename(Path(workspace.bridge.source), name)
    description = workspace.folder / "bridge.toml"
    answer(
        {"workspace": str(workspace.folder), "description": str(description)},
        f"Made {workspace.folder}. Describe the bridge in {description}.",
    )


def _rename(path: Path, name: str) -> None:
    """Put the name into the table [bridge], comments and all else left as they are."""
    text = path.read_text(encoding="utf-8")
    line = f"name = {json.dumps(name, ensure_ascii=False)}"
    head = re.compile(r"^\[bridge\][^\n]*\n(?:name\s*=[^\n]*\n)?", re.MULTILINE)
    if head.search(text):
        text = head.sub(lambda found: f"[bridge]\n{line}\n", text, count=1)
    else:
        text = f"[bridge]\n{line}\n\n{text}"
    path.write_text(text, encoding="utf-8")
