"""`shm settings --assumptions`: the physical assumptions that hold, each with source and reason."""

from __future__ import annotations

import textwrap
from pathlib import Path

import rich_click as click

from shm.assumptions import DEFAULTS, Assumption, Assumptions, number_text, row_document
from shm_cli.common import is_workspace, one_hanger, open_workspace, readable_width, show

ASSUMPTIONS_SCHEMA = "shm.assumptions/1"


def show_assumptions(hanger_file: Path | None, hanger_id: int | None, as_json: bool) -> None:
    """Print the table of a hanger, of the bridge, or of the defaults outside of a workspace."""
    assumed = _in_force(hanger_file, hanger_id)
    if as_json:
        rows = {name: row_document(row) for name, row in assumed.items()}
        show({"schema": ASSUMPTIONS_SCHEMA, "assumptions": rows})
    else:
        click.echo("\n".join(_paragraph(row) for row in assumed.values()))


def _in_force(hanger_file: Path | None, hanger_id: int | None) -> Assumptions:
    if hanger_file is not None or hanger_id is not None:
        return one_hanger(hanger_file, hanger_id).assumptions
    return open_workspace().bridge.assumptions if is_workspace() else DEFAULTS


def _paragraph(row: Assumption) -> str:
    """Return a row as a terminal of any width shows it: its numbers, and the reason below."""
    unit = "" if row.unit == "1" else f" {row.unit}"
    head = f"{row.name} = {number_text(row)}{unit} ({row.origin})"
    source = "" if row.source == row.origin else f" Source: {row.source}."
    why = textwrap.fill(f"{row.reason}{source}", max(readable_width() - 4, 20))
    return f"{head}\n{textwrap.indent(why, '    ')}"
