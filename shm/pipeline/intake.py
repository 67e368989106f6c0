"""Taking a file in, so that a process killed at any instant loses nothing and doubles nothing.

The file is safe in the archive before it is entered, and entered before it leaves the spool.
"""

from __future__ import annotations

import os
import uuid
from collections import Counter
from datetime import datetime
from pathlib import Path

from shm.errors import BadInput
from shm.read import sidecar_path
from shm.store import Receipt, ReceivedFile, Store, Workspace
from shm.store.archive import Kept, entry_of, safe_name


class Sharing:
    """How many files wait for the same sidecar; each folder is listed once.

    One for each look into the spool: with one for each file, ten thousand files would be listed
    ten thousand times.
    """

    def __init__(self) -> None:
        self._waiting: dict[Path, Counter[Path]] = {}

    def others_need(self, sidecar: Path) -> bool:
        """Whether more than one file of the folder waits for a sidecar."""
        return self._of(sidecar.parent)[sidecar] > 1

    def taken(self, sidecar: Path) -> None:
        """One of the files that waited for it is there no more."""
        self._of(sidecar.parent)[sidecar] -= 1

    def _of(self, folder: Path) -> Counter[Path]:
        if folder not in self._waiting:
            pairs = ((entry, sidecar_path(entry)) for entry in folder.iterdir())
            self._waiting[folder] = Counter(sidecar for entry, sidecar in pairs if entry != sidecar)
        return self._waiting[folder]


def receive(
    path: Path, workspace: Workspace, store: Store, at: datetime, sharing: Sharing | None = None
) -> Receipt:
    """Archives a whole file with its sidecar, enters it, and removes it where it was spooled.

    Raises BadInput where a link leads out of the spool, ShmError with `retry_after_s` where the
    file changes meanwhile or cannot be read, StoreError where archive or store cannot take it.
    """
    name, spooled = _place(path, workspace.spool)
    path = path.parent.resolve() / path.name
    sidecar, archive = sidecar_path(path), workspace.archive
    kept_sidecar = archive.keep(sidecar) if _is_plain(sidecar) else None
    kept = archive.keep(path, follow=not spooled)
    file = ReceivedFile(
        kept.sha256,
        safe_name(name),
        kept.size_bytes,
        kept.entry if spooled else uuid.uuid4().hex,
        kept.archived_as,
        kept_sidecar.archived_as if kept_sidecar else None,
    )
    receipt = store.receive(file, at)
    if spooled:
        _remove(path, kept, kept_sidecar, sharing or Sharing())
    return receipt


def _place(path: Path, spool: Path) -> tuple[Path, bool]:
    """By what name a file is known, and whether it lies in the spool."""
    found, root = path.parent.resolve() / path.name, spool.resolve()
    if found.is_relative_to(root):
        return found.relative_to(root), True
    if Path(os.path.normpath(path.absolute())).is_relative_to(spool):
        raise BadInput(
            f"its folder {path.parent} is a link that leads out of the spool.",
            file=path,
            remedy="Put the folder itself in its place.",
        )
    return Path(path.name), False


def _remove(path: Path, kept: Kept, kept_sidecar: Kept | None, sharing: Sharing) -> None:
    """Empties the spool of a received file; its sidecar first, lest that be left alone.

    What has come under either name since it was read stays, to be taken in its turn.
    """
    sidecar = sidecar_path(path)
    if kept_sidecar is not None and not sharing.others_need(sidecar):
        _remove_if_still(sidecar, kept_sidecar)
    _remove_if_still(path, kept)
    sharing.taken(sidecar)


def _remove_if_still(path: Path, kept: Kept) -> None:
    try:
        if entry_of(path.lstat()) == kept.entry:
            path.unlink(missing_ok=True)
    except FileNotFoundError:
        return


def _is_plain(sidecar: Path) -> bool:
    """A link may point to any file of this machine, which is nobody's to send in."""
    return sidecar.is_file() and not sidecar.is_symlink()
