"""Write the golden files of the contract of the watch.

    python tests/contracts/write_watch_golden.py

Write a file again only where the contract itself is changed, with a line in CHANGELOG.md; a file
that is there is left as it is.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "cli")]

from shm.documents import dump  # noqa: E402
from shm.modes_document import modes_document  # noqa: E402
from tests.contracts import watch_calls as calls  # noqa: E402
from tests.contracts.golden_files import compress, shorten, write_missing  # noqa: E402


def main() -> None:
    """Write each golden file that is missing."""
    made = {
        **{
            calls.FOLDER / f"{name}.modes.json": partial(modes_document, calls.make_history(name))
            for name in calls.STATES
        },
        calls.FOLDER / "deck.modes.json": partial(modes_document, calls.make_deck()),
        **{calls.FOLDER / f"{name}.json": make for name, make in calls.CASES.items()},
    }
    write_missing(
        {
            path: lambda m=make: compress(dump(shorten(calls.read_back(m()))))
            for path, make in made.items()
        }
    )


if __name__ == "__main__":
    main()
