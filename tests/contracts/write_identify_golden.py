"""Write the golden files of the contract of identification.

    python tests/contracts/write_identify_golden.py

They were written before the room was rebuilt on pyOMA2, of `command_*` without the check
`cross-check`, which is now asked for by an option. Write a file again only where the contract
itself is changed, with a line in CHANGELOG.md; a file that is there is left as it is.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "cli")]

from tests.contracts import identify_calls as calls  # noqa: E402
from tests.contracts.golden_files import compress, shorten, write_missing  # noqa: E402


def commanded(name: str) -> Any:
    """Return the document of one of `COMMANDS`."""
    with tempfile.TemporaryDirectory() as folder:
        return calls.identify_file(*calls.COMMANDS[name], Path(folder))


FILES: dict[str, Callable[[], Any]] = {
    **{name: lambda n=name: commanded(n) for name in calls.COMMANDS},  # type: ignore[misc]
    **{name: lambda k=kind: calls.identify_record(*k) for name, kind in calls.FRONTS.items()},  # type: ignore[misc]
    calls.UNDESCRIBED: lambda: calls.identify_record(*calls.FRONTS["plain"], is_described=False),
    calls.REFUSED: calls.refuse_records,
}


def main() -> None:
    """Write each golden file that is missing."""
    made = {calls.FOLDER / f"{name}.json": make for name, make in FILES.items()}
    write_missing(
        {path: lambda m=make: compress(json.dumps(shorten(m()))) for path, make in made.items()}
    )


if __name__ == "__main__":
    main()
