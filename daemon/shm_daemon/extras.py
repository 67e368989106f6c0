"""Parts of the daemon that need a library which is not always installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from shm.errors import UsageError


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Says which extra to install where an import in this context fails."""
    try:
        yield
    except ImportError as error:
        raise UsageError(
            f"{error.name or 'a library'} is not installed.",
            remedy=f"Install it with `pip install 'shm[{extra}]'`.",
        ) from error
