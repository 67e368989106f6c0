"""Hanger 3 of the thesis, described and measured: an example with real frequencies."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent
HANGER_FILE = _FOLDER / "hanger3.toml"
MODES_FILE = _FOLDER / "hanger3.modes.json"
"""Table 1.1 of the thesis."""
