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


def shorten(value: Any) -> Any:
    """Return a document with its numbers to six digits."""
    if isinstance(value, dict):
        return {key: shorten(each) for key, each in value.items()}
    if isinstance(value, list):
        return [shorten(each) for each in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def compress(document: Any) -> str:
    """Return a document in few lines: one for each part of its first level."""
    parts = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in document.items()]
    return "{\n" + ",\n".join(parts) + "\n}\n"


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
    for name, make in FILES.items():
        path = calls.FOLDER / f"{name}.json"
        if not path.exists():
            path.write_text(compress(shorten(make())), encoding="utf-8")
            print(f"{path.name}: {path.stat().st_size / 1000:.1f} kB", flush=True)


if __name__ == "__main__":
    main()
