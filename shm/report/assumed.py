"""Report which physical assumptions were overridden, and how to see all."""

from __future__ import annotations

from typing import Any

from shm.assumptions import DEFAULTS, number_text
from shm.report.paper import Table
from shm.values import Hanger

HOW_TO_SEE_ALL = "`shm settings --assumptions` lists every one with its source and reason."


def assumptions_line(hanger: Hanger) -> str:
    """Return the sentence on the assumptions of a hanger, with each that was overridden."""
    overridden = hanger.assumptions.overridden
    if not overridden:
        return f"All physical assumptions are the defaults. {HOW_TO_SEE_ALL}"
    stated = ", ".join(f"{row.name} = {number_text(row)} {row.unit}".rstrip() for row in overridden)
    return f"Assumed otherwise than by default: {stated}. {HOW_TO_SEE_ALL}"


def assumptions_table(hanger: Hanger) -> Table:
    """Return the overridden assumptions next to the defaults; without rows where there is none."""
    return Table(
        "Assumptions that were overridden",
        ("assumption", "value", "default", "unit", "from", "reason"),
        tuple(
            (row.name, number_text(row), usual, row.unit, row.origin, row.reason)
            for row in hanger.assumptions.overridden
            for usual in (number_text(DEFAULTS[row.name]),)
        ),
    )


def with_assumptions(document: dict[str, Any], hanger: Hanger) -> dict[str, Any]:
    """Return a document with `assumptions`, the overridden rows by name; as it is without any."""
    overridden = hanger.assumptions.document()
    return {**document, "assumptions": overridden} if overridden else document
