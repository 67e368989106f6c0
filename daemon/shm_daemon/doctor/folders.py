"""The workspace as files: folders, permissions, room on the disks. Needs no store."""

from __future__ import annotations

import os
import pwd
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from shm.settings import Settings
from shm.store.workspace import FOLDERS
from shm_daemon.doctor.contract import Finding, fault, ok, some, warning

_GIGABYTE = 1e9
_NEARLY_FULL = 0.1


def check_folders(folder: Path) -> Iterator[Finding]:
    """Whether the folders of a workspace are there and we may write in them."""
    missing = [name for name in FOLDERS if not (folder / name).is_dir()]
    if missing:
        yield fault(
            "folders",
            f"{some(missing)} missing in {folder}",
            "Is a disk not mounted? Else the next command makes them, empty.",
        )
    wanted = [folder, *(folder / name for name in FOLDERS if name not in missing)]
    closed = [path for path in wanted if not os.access(path, os.R_OK | os.W_OK | os.X_OK)]
    if closed:
        yield fault(
            "permissions",
            f"this user cannot write in {some([str(path) for path in closed])}",
            "Give the folders to the user who runs the daemon: chown -R.",
        )
    yield from _owner(folder)
    if not missing and not closed:
        yield ok("folders", str(folder))


def _owner(folder: Path) -> Iterator[Finding]:
    owner, ours = folder.stat().st_uid, os.geteuid()
    if owner != ours:
        yield warning(
            "permissions",
            f"the folder belongs to user {_name(owner)}, this is user {_name(ours)}",
            f"Ask as that user, who sees what the daemon sees: sudo -u {_name(owner)} shm doctor.",
        )
    described = folder / "bridge.toml"
    if described.exists() and described.stat().st_mode & stat.S_IWOTH:
        yield fault(
            "permissions",
            "everybody can change bridge.toml, and so the programs that hooks run",
            f"chmod o-w {described}",
        )


def check_disks(folder: Path, settings: Settings) -> Iterator[Finding]:
    """Whether there is room wherever we write."""
    places = {
        "workspace": folder,
        "archive": folder / "archive",
        "temporary files": Path(tempfile.gettempdir()),
    }
    seen: set[int] = set()
    for what, path in places.items():
        if path.exists() and path.stat().st_dev not in seen:
            seen.add(path.stat().st_dev)
            yield _room(what, path, settings.min_free_bytes)


def _room(what: str, path: Path, wanted_bytes: int) -> Finding:
    usage = shutil.disk_usage(path)
    found = f"{what}: {usage.free / _GIGABYTE:.1f} of {usage.total / _GIGABYTE:.0f} GB free"
    remedy = "Free some space; `shm archive prune --dry-run` says what could go."
    if usage.free < _NEARLY_FULL * wanted_bytes:
        return fault("disk", found, remedy)
    if usage.free < wanted_bytes:
        return warning("disk", found, remedy)
    return ok("disk", found)


def _name(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)
