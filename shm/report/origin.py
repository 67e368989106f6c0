"""Where the numbers of a report come from: files, checksums, settings, classes, versions."""

from __future__ import annotations

from collections.abc import Mapping

from shm.report import formatting
from shm.report.paper import Table
from shm.settings import TABLE
from shm.values import ModalTest

_LINEAGE = {
    "file_name": "file of the latest test",
    "file_sha256": "SHA-256 of that file",
    "received": "received",
    "input_sha256": "SHA-256 of the identification's input",
    "settings_sha256": "SHA-256 of its settings",
    "version": "identified by shm version",
    "baseline": "baseline",
    "software": "computed on",
}


def lineage(told: Mapping[str, str]) -> dict[str, str]:
    """What a result was made from, its keys in words."""
    return {_LINEAGE.get(key, formatting.quantity(key)): value for key, value in told.items()}


def added_mass(test: ModalTest) -> str:
    mass = test.added_mass
    return f"{mass.mass_kg:g} kg at {mass.x_m:g} m from the deck end" if mass else "none"


def settings(told: Mapping[str, str]) -> Table:
    """The settings that decide the numbers, each with its unit; empty where nobody says."""
    helps = {row.name: row.help for row in TABLE}
    return Table(
        "Settings in force",
        ("setting", "value", "what it is"),
        tuple((name, _spaced(value), helps.get(name, "")) for name, value in told.items()),
        note="Of identification, updating and watch, as they stand now: given, without interval.",
    )


def _spaced(value: str) -> str:
    """`beam1,beam2` as a list that folds."""
    return ", ".join(value.split(","))
