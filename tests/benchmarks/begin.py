"""What every benchmark begins with: this checkout on the path, one thread a process, its options.

Imported before numpy: more threads only wait for each other.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TRIALS = ROOT / "docs" / "trials"
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(ROOT / folder) for folder in ("", "daemon", "cli")]
sys.path += [str(HERE), str(HERE / "identification")]
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


class Told(NamedTuple):
    """An option with its help."""

    value: Any
    help: str


def options(description: str | None, **known: Any) -> argparse.Namespace:
    """Parse the command line: an option for each name, of the type of its default.

    False is a flag, a tuple choices (the first is the default), a list several words, a type an
    option that may be left out.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, value in known.items():
        told = value if isinstance(value, Told) else Told(value, "")
        given = told.value
        kind: dict[str, Any] = {"type": type(given), "default": given}
        if given is False:
            kind = {"action": "store_true"}
        elif isinstance(given, tuple):
            kind = {"choices": given, "default": given[0]}
        elif isinstance(given, list):
            kind = {"nargs": "*", "default": given}
        elif isinstance(given, type):
            kind = {"type": given}
        elif isinstance(given, Path):
            kind = {"type": Path, "default": given}
        parser.add_argument("--" + name.replace("_", "-"), help=told.help, **kind)
    return parser.parse_args()
