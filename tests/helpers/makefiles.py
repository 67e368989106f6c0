"""Targets of the Makefiles, and the commands that they would run."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

_PHONY = re.compile(r"^\.PHONY:((?:.*\\\n)*.*)$", re.MULTILINE)


def make_targets(folder: Path) -> set[str]:
    """Return the names that the Makefile of a folder declares as commands."""
    found = _PHONY.search((folder / "Makefile").read_text(encoding="utf-8"))
    assert found is not None, f"{folder}/Makefile declares no .PHONY"
    return set(found[1].replace("\\\n", " ").split())


def dry_run(folder: Path, *target: str) -> str:
    """Return the commands that make would run for a target, variables after it."""
    shown = subprocess.run(
        ["make", "--dry-run", "--directory", str(folder), *target],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert shown.returncode == 0, shown.stderr
    return shown.stdout
