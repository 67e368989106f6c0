"""What the thesis measured and found on hanger 3, as data."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from shm.modes_document import load_modes
from shm.values import ModalTest
from shm_cli.example import MODES_FILE

FOLDER = Path(__file__).parent
TABLES_FILE = FOLDER / "tables.toml"
CHECKLIST_FILE = FOLDER / "checklist.toml"

PRINTINGS = {
    "table 1.1": MODES_FILE,
    "table A.4": FOLDER / "table_a_4.modes.json",
}
"""The same measurement, printed twice with three differing values."""

EVIDENCE = {
    "beam1": 434.49,
    "beam2": 497.11,
    "solid0": 385.04,
    "solid1": 512.58,
    "solid2": 515.42,
}
"""Table 5.1; its normalisation is unknown, only order and sign of differences compare."""

DEVIATION_FROM_NOMINAL = {
    "beam1": 0.05,
    "beam2": -0.04,
    "solid0": -0.20,
    "solid1": 0.04,
    "solid2": 0.01,
}
"""Table 6.1: most probable tension over nominal tension, less 1."""

EVALUATION_TIME = {
    "beam1": "5 min",
    "beam2": "5 min",
    "solid0": "24 h",
    "solid1": "36 h",
    "solid2": "48 h",
}
"""Table 6.1, on a machine that it does not name."""

OTHER_NOMINAL_TENSION_N = 835e3
"""Section 3.1.1: of the transverse direction; the longitudinal gave the description's 711 kN."""


def measured_tests(printing: str, n_times: int = 1) -> list[ModalTest]:
    """Return the tests of one of `PRINTINGS`, counted `n_times` times (N_D of the thesis)."""
    return count_times(load_modes(PRINTINGS[printing]), n_times)


def count_times(tests: Sequence[ModalTest], n_times: int) -> list[ModalTest]:
    """Return equal copies of `tests`: with the thesis's priors each data set counts as new."""
    return [
        test if n == 0 else replace(test, id=f"{test.id}, copy {n}")
        for n in range(n_times)
        for test in tests
    ]


def checklist() -> list[dict[str, str]]:
    """Every item of the thesis: `of` it, `what` it is, `where` ours is."""
    items: list[dict[str, str]] = tomllib.loads(CHECKLIST_FILE.read_text(encoding="utf-8"))["item"]
    return items
