"""Contain faults: one hanger's rows stop that hanger alone, one file goes with its reason."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from shm.errors import BadInput, ShmError, StoreDamaged
from shm.read import sidecar_path
from shm.store import Workspace
from shm.store.files import reason_document


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


def explain_refusal(
    error: BaseException, file_name: str, sha256: str | None, at: datetime
) -> dict[str, Any]:
    """Return the document with the file, line and channel at fault, the message and the remedy."""
    message = f"internal error: {error!r}."
    remedy = "Report this with the log, then drop the file again."
    if isinstance(error, ShmError):
        message, remedy = error.message, error.remedy
    reason = reason_document(file_name, sha256, message, remedy, at)
    if isinstance(error, BadInput):
        file = Path(error.file).name or file_name
        reason |= {"file": file, "line": error.line, "channel": error.channel or None}
    return reason


def move_to_quarantine(
    workspace: Workspace, path: Path, name: str, error: BadInput, at: datetime, sha256: str | None
) -> Path:
    """Move a refused file and its sidecar into the quarantine, with the reason; return its path."""
    reason = explain_refusal(error, name, sha256, at) | {"file": name}
    return workspace.quarantine.move(path, name, reason, sidecar_path(path))
