"""Taking a file in, so that a process killed at any instant loses nothing and doubles nothing.

The file is safe in the archive before it is entered, and entered before it leaves the spool.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from shm.errors import BadInput, TooLarge
from shm.pipeline.faults import move_to_quarantine
from shm.pipeline.lineage import read_limits
from shm.read import sidecar_path
from shm.read.profiles import any_profile, completed, learn_day_order, profile_for
from shm.read.sandbox import layout_of
from shm.read.sidecar import sidecar_document, sidecar_text
from shm.read.stamps import may_hold_days, order_of_choice
from shm.store import Hold, Receipt, ReceivedFile, Store, Workspace
from shm.store.archive import (
    MODES_SUFFIX,
    ArchivedFile,
    ProgressCallback,
    do_nothing,
    inode_identity,
    refuse_oversize,
    safe_name,
)
from shm.store.journal import list_events


def receive(
    path: Path,
    workspace: Workspace,
    store: Store,
    at: datetime,
    on_progress: ProgressCallback = do_nothing,
) -> Receipt:
    """Archives a whole file with its sidecar, enters it, and removes it where it was spooled.

    Raises TooLarge for a file, or a sidecar, beyond the setting max_file_bytes; where it was
    spooled it lies in the quarantine then, or else where it was. Raises BadInput where a link leads
    out of the spool, ShmError with `retry_after_s` where the file changes meanwhile or cannot be
    read, StoreError where archive or store cannot take it.
    """
    name, spooled = _place(path, workspace.spool)
    path = path.parent.resolve() / path.name
    sidecar, modified_at = sidecar_path(path), _modified(path)
    try:
        archived_sidecar, archived = _keep(path, sidecar, workspace, not spooled, on_progress)
    except TooLarge as error:
        if spooled:
            _quarantine(path, safe_name(name), error, workspace, store, at)
        raise
    file = ReceivedFile(
        archived.sha256,
        safe_name(name),
        archived.size_bytes,
        archived.entry if spooled else uuid.uuid4().hex,
        archived.archived_as,
        archived_sidecar.archived_as if archived_sidecar else None,
        modified_at,
    )
    receipt = store.recordings.receive(file, at)
    if spooled:
        _remove(path, archived, archived_sidecar)
    return receipt


def _modified(path: Path) -> datetime | None:
    """Return when the file was last written; None where its folder says something impossible."""
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC)
    except (OSError, OverflowError, ValueError):
        return None


def _keep(
    path: Path, sidecar: Path, workspace: Workspace, follow: bool, on_progress: ProgressCallback
) -> tuple[ArchivedFile | None, ArchivedFile]:
    archive, most = workspace.archive, workspace.settings.max_file_bytes
    refuse_oversize(path.stat(follow_symlinks=follow).st_size, most, path)
    archived_sidecar = None
    if _is_plain(sidecar):
        archived_sidecar = archive.keep(sidecar, most_bytes=most, on_progress=on_progress)
    is_read = follow or not path.is_symlink()
    text = _sidecar_by_profile(path, workspace, learns=True) if is_read else None
    if text is not None:
        with tempfile.TemporaryDirectory(prefix="shm-") as folder:
            made_up = Path(folder) / sidecar.name
            made_up.write_text(text, encoding="utf-8")
            made = archive.keep(made_up, most_bytes=most, on_progress=on_progress)
        archived_sidecar = replace(made, entry=archived_sidecar.entry) if archived_sidecar else made
    return archived_sidecar, archive.keep(
        path, follow=follow, most_bytes=most, on_progress=on_progress, under_any_suffix=True
    )


@contextmanager
def as_taken_in(path: Path, workspace: Workspace) -> Iterator[Path]:
    """A recording beside the sidecar with which it would be taken in: itself, or a copy for as
    long as it is used, where its logger's profile says more than its own sidecar."""
    text = _sidecar_by_profile(path, workspace, learns=False)
    if text is None:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="shm-") as folder:
        copied = Path(shutil.copy2(path, folder))
        sidecar_path(copied).write_text(text, encoding="utf-8")
        yield copied


def _sidecar_by_profile(path: Path, workspace: Workspace, *, learns: bool) -> str | None:
    """Make the sidecar of a file: what its logger's profile and the zone add to its own, with it.

    A profile that `learns` from the file does so first. The sidecar is kept with the file, so that
    a profile which changes later changes no test of before. None where nothing is added, and of
    what cannot be read.
    """
    zone, folder = workspace.bridge.time_zone, workspace.folder
    may_add = any_profile(folder) or zone is not UTC or (learns and may_hold_days(path))
    if not may_add or path.name.lower().endswith(MODES_SUFFIX):
        return None
    try:
        layout, sidecar = layout_of(path, read_limits(workspace.settings)), sidecar_document(path)
    except BadInput:
        return None  # it is refused with its reason where it is read
    if learns:
        profile = learn_day_order(layout, layout.day_order, folder)
    else:
        profile = profile_for(layout, folder)
    if profile is None and zone is UTC:
        return None
    known = profile.described if profile is not None else {}
    complete = completed(known, layout, sidecar, path.name, zone)
    return sidecar_text(complete) if complete != sidecar else None


def learn_from_answer(workspace: Workspace, store: Store, hold: Hold) -> None:
    """Store the order of day and month of a logger that a person's answer to a hold tells."""
    if hold.time is None or all(doubt.check != "clock ambiguous" for doubt in hold.doubts):
        return
    recording = store.recordings.get(hold.recording_id)
    try:
        with workspace.archive.opened(recording.file) as path:
            layout = layout_of(path, read_limits(workspace.settings))
    except BadInput:
        return  # an archive of several loggers has no layout
    order = order_of_choice(hold.time, layout.possible_times)
    learn_day_order(layout, order, workspace.folder)


def _quarantine(
    path: Path, name: str, error: TooLarge, workspace: Workspace, store: Store, at: datetime
) -> None:
    """Lays what is too large in the quarantine, unread: nobody knows its checksum."""
    lies = move_to_quarantine(workspace, path, name, error, at, None)
    messages = {event.message for event in list_events(store, "refused", file_name=name)}
    if lies != path or error.message not in messages:  # what stays is met at each start
        store.recordings.refuse_unread(name, error.message, at)


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


def _remove(path: Path, archived: ArchivedFile, archived_sidecar: ArchivedFile | None) -> None:
    """Empties the spool of a received file; its sidecar first, lest that be left alone.

    A sidecar that another file waits for, as NAME.uff beside NAME.csv, stays.

    What has come under either name since it was read stays, to be taken in its turn.
    """
    sidecar = sidecar_path(path)
    if archived_sidecar is not None:
        others = {each for each in path.parent.iterdir() if sidecar_path(each) == sidecar}
        if not others - {path, sidecar}:
            _remove_if_still(sidecar, archived_sidecar)
    _remove_if_still(path, archived)


def _remove_if_still(path: Path, archived: ArchivedFile) -> None:
    try:
        if inode_identity(path.lstat()) == archived.entry:
            path.unlink(missing_ok=True)
    except FileNotFoundError:
        return


def _is_plain(sidecar: Path) -> bool:
    """A link may point to any file of this machine, which is nobody's to send in."""
    return sidecar.is_file() and not sidecar.is_symlink()
