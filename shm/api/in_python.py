"""Remedies of errors for one who works in Python: calls in place of commands and files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from shm.errors import ShmError

_CALLS: tuple[tuple[str, str], ...] = (
    (
        r"Make a workspace with `shm init`.*",
        "Give the path of a file with [[hanger]] tables, or of a folder with a bridge.toml; "
        "shm.round_bar(...) describes a bar without a file.",
    ),
    (r"[;.]? `shm import FILE` asks and keeps it for all files of this logger", ""),
    (r", or say it once for this logger: `shm import FILE`", ""),
    (
        r"`?shm import FILE`?( asks for it and keeps it for all files of this logger)?",
        "shm.read(path, units=..., planes=..., places_m=...)",
    ),
    (r"`shm gap diagnose[^`]*`", "shm.diagnose(tests, hanger)"),
    (r"`shm gap check[^`]*`", "shm.check_gap(tests, hanger)"),
    (r"`shm select[^`]*`", "shm.select(tests, hanger)"),
    (r"`shm update[^`]*`", "shm.update(tests, hanger)"),
    (r"`shm identify[^`]*`", "shm.identify(records, hanger=hanger)"),
    (r"say which with --hanger N", "say which: shm.load_hanger(path, 3)"),
    (r"`?(?:shm )?ingest --together`?", "shm.identify([first, second], hanger=hanger)"),
)
"""Commands in remedies, and what does the same in Python."""
_BY_READ: tuple[tuple[str, str], ...] = (
    (r"(?=.*\b(planes?|x_m)\b)(?=.*\b(sidecar|header)\b)", "planes={...}, places_m={...}"),
    (r"give its unit|Give one of N, |with unit = (?!.*calibration)", "units={...}"),
)
"""Faults of a file's description, and the argument of `shm.read` that states it."""


@contextmanager
def in_python() -> Iterator[None]:
    """Let errors through with remedies that work where Python is written."""
    try:
        yield
    except ShmError as error:
        remedy = error.remedy
        for command, call in _CALLS:
            remedy = re.sub(command, lambda _, call=call: call, remedy)  # type: ignore[misc]
        for fault, arguments in _BY_READ:
            if re.search(fault, remedy, re.DOTALL):
                remedy = f"{remedy} In Python: shm.read(path, {arguments})."
        error.remedy = remedy
        raise
