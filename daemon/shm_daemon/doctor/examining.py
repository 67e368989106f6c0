"""All checks of a workspace, whatever is broken: what cannot be looked at is told, never raised."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

from shm.errors import ShmError
from shm.report.words import counted
from shm.store import Workspace
from shm_daemon.doctor.contract import Check, Examined, Finding, fault, ok, unknown
from shm_daemon.doctor.flowing import (
    check_daemon,
    check_held,
    check_quarantine,
    check_raw_files,
    check_spool,
    check_under_way,
)
from shm_daemon.doctor.folders import check_disks, check_folders
from shm_daemon.doctor.installed import (
    check_confinement,
    check_extras,
    check_models,
    check_versions,
)
from shm_daemon.doctor.keeping import check_backup, check_clock, check_hangers, check_store
from shm_daemon.doctor.telling import check_deliveries, check_hooks

_CHECKS: Sequence[tuple[str, Check]] = (
    ("store", check_store),
    ("daemon", check_daemon),
    ("spool", check_spool),
    ("recordings", check_under_way),
    ("quarantine", check_quarantine),
    ("held", check_held),
    ("raw files", check_raw_files),
    ("backup", check_backup),
    ("clock", check_clock),
    ("deliveries", check_deliveries),
    ("hangers", check_hangers),
)
_REPORT = "This is a fault of shm; please report it."


def examine(folder: Path, now: datetime) -> tuple[Finding, ...]:
    """What all checks of a workspace find; those that need what is broken are left out."""
    folder = folder.resolve()
    findings = [*_found("versions", check_versions)]
    if not folder.is_dir():
        return (*findings, fault("folders", f"{folder} is no folder", "Make it with `shm init`."))
    findings += _found("folders", partial(check_folders, folder))
    try:
        workspace = Workspace.described(folder)
    except (ShmError, OSError) as error:
        return (*findings, _broken("bridge.toml", error))
    described = f"{workspace.bridge.name}, {counted(len(workspace.bridge.hangers), 'hanger')}"
    findings.append(ok("bridge.toml", described))
    findings += _found("disk", partial(check_disks, folder, workspace.settings))
    findings += _found("models", partial(check_models, workspace))
    findings += _found("extras", partial(check_extras, workspace))
    findings += _found("confinement", check_confinement)
    findings += _found("hooks", partial(check_hooks, workspace))
    return (*findings, *_of_store(workspace, now))


def _of_store(workspace: Workspace, now: datetime) -> Iterator[Finding]:
    try:
        store = workspace.store()
    except (ShmError, OSError) as error:
        yield _broken("store", error)
        yield unknown("flow", "what needs the store was not looked at", "Mend the store first.")
        return
    with store:
        for name, check in _CHECKS:
            yield from _found(name, partial(check, Examined(workspace, store, now)))


def _found(name: str, check: Callable[[], Iterable[Finding]]) -> list[Finding]:
    try:
        return list(check())
    except (ShmError, OSError) as error:
        return [_broken(name, error)]
    except Exception as error:  # noqa: BLE001 - one check that fails must not hide the others
        return [unknown(name, f"{type(error).__name__}: {error}", _REPORT)]


def _broken(name: str, error: ShmError | OSError) -> Finding:
    if isinstance(error, ShmError):
        where = f"{error.where}: " if error.where else ""
        return fault(name, f"{where}{error.message}", error.remedy)
    return fault(name, f"{error.filename or ''}: {error.strerror or error}", "See permissions.")
