"""`shm settings --assumptions`: the physical assumptions that hold, each with source and reason."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import rich_click as click

from shm.assumptions import DEFAULTS, Assumption, Assumptions, number_text, row_document
from shm_cli.common import is_workspace, markdown, one_hanger, open_workspace, readable_width, show

ASSUMPTIONS_SCHEMA = "shm.assumptions/1"
_HEADS = ("assumption", "value", "unit", "from", "source", "reason")


def show_assumptions(
    ctx: click.Context, hanger_file: Path | None, hanger_id: int | None, as_json: bool
) -> None:
    """Print the table of a hanger, of the bridge, or of the defaults outside of a workspace."""
    assumed = _in_force(ctx, hanger_file, hanger_id)
    if as_json:
        rows = {name: row_document(row) for name, row in assumed.items()}
        show({"schema": ASSUMPTIONS_SCHEMA, "assumptions": rows})
    else:
        click.echo("\n".join(_paragraph(row) for row in assumed.values()))


def _in_force(ctx: click.Context, hanger_file: Path | None, hanger_id: int | None) -> Assumptions:
    if hanger_file is not None or hanger_id is not None:
        return one_hanger(ctx, hanger_file, hanger_id).assumptions
    return open_workspace(ctx).bridge.assumptions if is_workspace(ctx) else DEFAULTS


def assumptions_section() -> str:
    """Return the section of the manual that lists the defaults, in Markdown."""
    head = (
        "## Assumptions\n\n"
        "What is taken of hangers, sensors and measurements before any data. `[assumptions]` of "
        "`bridge.toml` replaces rows for the bridge, `[hanger.assumptions]` for one hanger; what "
        "`[hanger.scatter]` states goes before both. Every report says what was replaced, and "
        "`shm settings --assumptions` lists what holds. Reasons for one table: [0007]"
        "(decisions/0007-one-table-of-assumptions.md).\n\n"
        "```toml\n"
        "[assumptions]\n"
        "accelerometer_mass_kg = 0.2\n"
        "strand_bending_factor = [0.5, 1]         # compacted strands\n"
        'tension_reading_sd = {value = 0.01, reason = "jack calibrated in 2026"}\n'
        "```\n\n"
    )
    rows = [(f"`{row.name}`", *_cells(row)[1:3], *_cells(row)[4:]) for row in DEFAULTS.values()]
    return head + markdown((*_HEADS[:3], *_HEADS[4:]), rows) + "\n"


def _paragraph(row: Assumption) -> str:
    """Return a row as a terminal of any width shows it: its numbers, and the reason below."""
    unit = "" if row.unit == "1" else f" {row.unit}"
    head = f"{row.name} = {number_text(row)}{unit} ({row.origin})"
    source = "" if row.source == row.origin else f" Source: {row.source}."
    why = textwrap.fill(f"{row.reason}{source}", max(readable_width() - 4, 20))
    return f"{head}\n{textwrap.indent(why, '    ')}"


def _cells(row: Assumption) -> tuple[str, ...]:
    source = re.sub(r"^docs/", "", row.source)
    return row.name, number_text(row), row.unit, row.origin, source, row.reason
