"""Import libraries that extras bring, where a file needs one."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from shm.errors import BadInput

_EXTRAS = {
    "csiio": ("campbell", "binary tables of Campbell loggers need", "have the logger write TOA5"),
    "nptdms": ("tdms", "TDMS needs", "export as CSV or UFF"),
    "pymseed": ("miniseed", "miniSEED needs", "export as CSV"),
}
"""By library: its extra, what needs it, and what else can be done."""


def import_extra(library: str, path: Path) -> Any:
    """Return a library, or a module of it; raises BadInput saying what to install."""
    try:
        return import_module(library)
    except ImportError:
        extra, needs, otherwise = _EXTRAS[library.partition(".")[0]]
        raise BadInput(
            f"{needs} the extra `{extra}`, which is not installed.",
            file=path,
            remedy=f"Install it (pip install 'shm[{extra}]'), or {otherwise}.",
        ) from None
