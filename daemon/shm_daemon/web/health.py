"""Health: what stops the work, and what only limits it.

`/health` answers load balancers and service managers.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import Any

from shm.errors import ShmError, sentence
from shm.pipeline import utc_now
from shm.pipeline.stream_health import backlog_leads, heard, leads_of, stream_leads
from shm.store.alerts import count_alerts, describe_silence
from shm.store.recordings import list_holds
from shm.store.tests import count_tests
from shm.values.messages import Lead
from shm_daemon.heartbeat import (
    NEARLY_FULL,
    duration_words,
    patience_s,
    seconds_since_beat,
    why_turn_failed,
)
from shm_daemon.spool import scan, unsupported_entries
from shm_daemon.web.site import Site

_NAMED = 5  # of many: the pages list them all

log = logging.getLogger(__name__)


def health_document(site: Site) -> tuple[int, dict[str, Any]]:
    """Return the answer of `/health`: its status and its document.

    Who is degraded still works: only who fails answers 503.
    """
    failing, degraded = troubles(site), limits(site)
    status = "failing" if failing else "degraded" if degraded else "ok"
    document = {"status": status, "reasons": [*failing, *degraded], "attention": attention(site)}
    return 503 if failing else 200, document


def troubles(site: Site) -> list[str]:
    """Return the reasons why work has stopped; empty if all is well."""
    return _states(_found(site, _store, _folders, _full_disk, _daemon))


def limits(site: Site) -> list[str]:
    """Return the reasons why work differs from its description; empty if all is well."""
    return _states(_found(site, _description, _undescribed, _backlog, _nearly_full_disk))


def attention(site: Site) -> list[str]:
    """Return what a person should look at although nothing fails."""
    return _states(_found(site, _held, _never_taken, _streams))


def notices(site: Site) -> list[Lead]:
    """Return the notices at the top of every page: limits of the work, with their remedies."""
    checks = (_last_turn, _nearly_full_disk, _description, _undescribed, _silences, _stream_leads)
    return [each for each in _found(site, *checks) if isinstance(each, Lead)]


def _states(found: Sequence[str | Lead]) -> list[str]:
    return [each if isinstance(each, str) else each.state for each in found]


def _found(site: Site, *checks: Callable[[Site], Sequence[str | Lead]]) -> list[str | Lead]:
    """Return the findings of all checks; a check that fails does not stop the others.

    One that the store fails says nothing: the check of the store does.
    """
    found: list[str | Lead] = []
    for check in checks:
        try:
            found += check(site)
        except ShmError as error:
            log.error("%s", error)
        except Exception:
            log.exception("a check of /health failed")
            name = check.__name__.strip("_").replace("_", " ")
            found.append(f"The check of the {name} failed; the log says more.")
    return found


def _last_turn(site: Site) -> list[Lead]:
    if silence := _silence(site):
        action = "Until it runs again (`shm daemon`), recordings wait and no alert is raised."
        return [Lead(silence, action)]
    failed = why_turn_failed(site.workspace).replace(f"{site.workspace.folder}{os.sep}", "")
    if not failed:
        return []
    action = "What it names waits until that is fixed; it is tried again each minute."
    return [Lead(f"The daemon's last turn failed: {sentence(failed)}", action)]


def _description(site: Site) -> list[Lead]:
    fault = site.fault
    if fault is None:
        return []
    where = fault.where or "bridge.toml"
    message = fault.message.replace(str(site.workspace.folder), "the workspace")
    state = f"{where}: {message} The description before is still in force."
    return [Lead(state, fault.remedy or "Correct the file; `shm doctor` looks at it again.")]


def _undescribed(site: Site) -> list[Lead]:
    """Return that hangers with tests are not described."""
    tested = count_tests(site.store).keys()
    missing = sorted(tested - {hanger.id for hanger in site.workspace.bridge.watched})
    if not missing:
        return []
    return [
        Lead(
            f"bridge.toml: hanger {_named(missing)} is not described, though tests of it are "
            "stored.",
            f"Add its table `[[hanger]]` with `id = {missing[0]}` to bridge.toml.",
        )
    ]


def _silences(site: Site) -> list[Lead]:
    now = utc_now()
    found = [each for each in site.store.silences.list_all() if each.is_in_force(now)]
    return [
        Lead(
            f"{text[0].upper()}{text[1:]}.",
            f"{'No' if each.is_maintenance else 'Each'} alert of that time is raised; it is ended "
            "on the page of alerts.",
        )
        for each in found
        for text in [describe_silence(each)]
    ]


def _stream_leads(site: Site) -> Sequence[Lead]:
    return stream_leads(heard(site.workspace, site.store, utc_now()))


def _streams(site: Site) -> Sequence[Lead]:
    return leads_of(heard(site.workspace, site.store, utc_now()))


def _backlog(site: Site) -> Sequence[Lead]:
    """Return what is not read of the streams."""
    return [*backlog_leads(heard(site.workspace, site.store, utc_now()))]


def _store(site: Site) -> list[str]:
    try:
        count_alerts(site.store)
    except ShmError as error:
        log.error("%s", error)
        return ["The store cannot be used."]
    return []


def _folders(site: Site) -> list[str]:
    workspace = site.workspace
    named = {"spool": workspace.spool, "archive": workspace.archive.folder}
    named["quarantine"] = workspace.quarantine.folder
    return [
        f"The {name} cannot be written."
        for name, folder in named.items()
        if not os.access(folder, os.W_OK | os.X_OK)
    ]


def _full_disk(site: Site, full_bytes: int = 32 << 20) -> list[str]:
    """Return that the disk is full: the largest chunk of a stream has no room on it.

    A daemon on a full disk cannot even write that its turn failed.
    """
    free = shutil.disk_usage(site.workspace.folder).free
    if free >= full_bytes:
        return []
    waiting = len(scan(site.workspace.spool))
    files = "1 file waits" if waiting == 1 else f"{waiting} files wait"
    waits = f", and {files} in the spool" if waiting else ""
    return [f"The disk is full: {free / 1e6:.0f} MB are free{waits}."]


def _nearly_full_disk(site: Site) -> list[Lead]:
    free = shutil.disk_usage(site.workspace.folder).free
    if _full_disk(site) or free >= NEARLY_FULL * site.workspace.settings.min_free_bytes:
        return []
    return [
        Lead(
            f"The disk is nearly full: {free / 1e6:.0f} MB are free.",
            "Free some space; `shm archive prune --dry-run` lists what could go.",
        )
    ]


def _silence(site: Site) -> str:
    """Return the message that the daemon is overdue; empty where it is not."""
    ago = seconds_since_beat(site.workspace)
    if ago is None:
        return "The daemon has never run here."
    is_late = ago > patience_s(site.workspace)
    return (
        f"The daemon was last seen {duration_words(timedelta(seconds=ago))} ago." if is_late else ""
    )


def _daemon(site: Site) -> list[str]:
    silence = _silence(site)
    if silence:
        return [silence]
    # Its words may name folders of the machine, and `/health` needs no token.
    failed = why_turn_failed(site.workspace)
    return ["The daemon's last turn failed; its log and `shm doctor` say why."] if failed else []


def _held(site: Site) -> list[str]:
    holds = list_holds(site.store)
    of_hangers: dict[int, list[int]] = {}
    for hold in holds:
        of_hangers.setdefault(hold.hanger, []).append(hold.recording_id)
    return [
        f"hanger {hanger}: "
        + (
            f"recording {ids[0]} is"
            if len(ids) == 1
            else f"{len(ids)} recordings ({_named(ids)}) are"
        )
        + " held until a person decides."
        for hanger, ids in sorted(of_hangers.items())
    ]


def _never_taken(site: Site) -> list[str]:
    count = len(unsupported_entries(site.workspace.spool))
    return [f"{count} of the spool will never be taken: see `shm doctor`."] if count else []


def _named(ids: Sequence[int]) -> str:
    return ", ".join(map(str, ids[:_NAMED])) + (" and others" if ids[_NAMED:] else "")
