"""Contain a fault: rows of one hanger stop that hanger, not the others nor the daemon."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager

from shm.errors import ShmError, StoreDamaged


@contextmanager
def contained(log: logging.Logger, message: str, *of: object) -> Iterator[None]:
    """Log what rows that cannot be read raise, and go on behind the block.

    A store or an executor that cannot be used now stops everything, and is raised.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, ShmError | BrokenExecutor) and not isinstance(error, StoreDamaged):
            raise
        log.exception(message, *of)
