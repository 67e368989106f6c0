"""Write the golden files of the contract of reading.

    python tests/contracts/write_read_golden.py

Write a file again only where the contract itself is changed, with a line in CHANGELOG.md; a file
that is there is left as it is.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "cli"), str(ROOT / "daemon")]

from shm.documents import dump  # noqa: E402
from tests.contracts import read_calls as calls  # noqa: E402
from tests.contracts.golden_files import write_missing  # noqa: E402


def main() -> None:
    """Write each golden file that is missing."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        made = calls.run_all(Path(folder), patch)
    write_missing(
        {
            calls.FOLDER / f"{name}.json": lambda d=document: dump(d)
            for name, document in made.items()
        }
    )


if __name__ == "__main__":
    main()
