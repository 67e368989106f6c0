"""Taking a file in, so that a process killed at any instant loses nothing and doubles nothing.

The file is safe in the archive before it is entered, and entered before it leaves the spool.
"""

from __future__ import annotations

import uuid
from datetime import datetime
from pathlib import Path

from shm.read import sidecar_path
from shm.store import Receipt, ReceivedFile, Store, Workspace
from shm.store.archive import safe_name


def receive(path: Path, workspace: Workspace, store: Store, at: datetime) -> Receipt:
    """Archives a whole file with its sidecar, enters it, and removes it where it was spooled.

    Raises ShmError with `retry_after_s` where the file changes meanwhile or cannot be read,
    StoreError where archive or store cannot take it.
    """
    path = path.parent.resolve() / path.name
    spooled = path.is_relative_to(workspace.spool)
    name = path.relative_to(workspace.spool) if spooled else Path(path.name)
    arrival = _arrival(path) if spooled else uuid.uuid4().hex
    sidecar, archive = sidecar_path(path), workspace.archive
    sidecar_as = archive.keep(sidecar).archived_as if _is_plain(sidecar) else None
    kept = archive.keep(path)
    file = ReceivedFile(
        kept.sha256, safe_name(name), kept.size_bytes, arrival, kept.archived_as, sidecar_as
    )
    receipt = store.receive(file, at)
    if spooled:
        _remove(path, sidecar)
    return receipt


def _arrival(path: Path) -> str:
    """What tells one spool entry from a later one of the same name and contents."""
    status = path.stat()
    return f"{status.st_ino}-{status.st_ctime_ns}"


def _remove(path: Path, sidecar: Path) -> None:
    """Empties the spool of a received file; its sidecar first, lest that be left alone."""
    if _is_plain(sidecar) and not _shared(sidecar, path):
        sidecar.unlink(missing_ok=True)
    path.unlink(missing_ok=True)


def _is_plain(sidecar: Path) -> bool:
    """A link may point to any file of this machine, which is nobody's to send in."""
    return sidecar.is_file() and not sidecar.is_symlink()


def _shared(sidecar: Path, path: Path) -> bool:
    """Whether another file of the folder waits for the same sidecar."""
    return any(
        sidecar_path(entry) == sidecar and entry not in (sidecar, path)
        for entry in path.parent.iterdir()
    )
