"""Whether all is well: what stops the work, and what only limits it.

`/health` answers for load balancers and service managers even while the pages are being loaded, so
that nothing here may import what they need.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from datetime import timedelta
from typing import Any

from shm.errors import BadInput, ShmError
from shm_daemon.heartbeat import patience_s, seconds_since_beat, told
from shm_daemon.web.site import Site

log = logging.getLogger(__name__)


def health_document(site: Site) -> tuple[int, dict[str, Any]]:
    """The answer of `/health`: its status and its document.

    Who is degraded still works: only who fails answers 503.
    """
    failing, degraded = troubles(site), limits(site)
    status = "failing" if failing else "degraded" if degraded else "ok"
    return 503 if failing else 200, {"status": status, "reasons": [*failing, *degraded]}


def troubles(site: Site) -> list[str]:
    """Why work stands still; empty where all is well."""
    return _found(site, _store, _spool, _daemon)


def limits(site: Site) -> list[str]:
    """Why work goes on otherwise than it is described; empty where all is well."""
    return _found(site, _description, _strangers)


def fault_in_words(fault: ShmError) -> str:
    """What is wrong with `bridge.toml`, and where."""
    where = fault.where if isinstance(fault, BadInput) and fault.where else "bridge.toml"
    return f"{where}: {fault.message} The description before is still in force."


def _found(site: Site, *checks: Callable[[Site], list[str]]) -> list[str]:
    return [reason for check in checks for reason in _looked_at(site, check)]


def _looked_at(site: Site, check: Callable[[Site], list[str]]) -> list[str]:
    """Whatever befalls one check, the others answer, and so does `/health`."""
    try:
        return check(site)
    except Exception:
        log.exception("a check of /health failed")
        return [f"The check of the {check.__name__.strip('_')} failed; the log says more."]


def _store(site: Site) -> list[str]:
    try:
        site.store.alert_counts()
    except ShmError as error:
        log.error("%s", error)
        return ["The store cannot be used."]
    return []


def _spool(site: Site) -> list[str]:
    if os.access(site.workspace.spool, os.W_OK | os.X_OK):
        return []
    return ["The spool cannot be written."]


def _daemon(site: Site) -> list[str]:
    ago = seconds_since_beat(site.workspace)
    if ago is None:
        return ["The daemon has never run here."]
    if ago > patience_s(site.workspace):
        return [f"The daemon was last seen {told(timedelta(seconds=ago))} ago."]
    return []


def _description(site: Site) -> list[str]:
    return [fault_in_words(site.fault)] if site.fault else []


def _strangers(site: Site) -> list[str]:
    try:
        tested = set(site.store.latest_tests())
    except ShmError:
        return []  # told as a trouble
    missing = sorted(tested - {hanger.id for hanger in site.workspace.bridge.hangers})
    if not missing:
        return []
    named = ", ".join(map(str, missing[:5])) + (" and others" if missing[5:] else "")
    return [f"bridge.toml does not describe hanger {named}, of which tests are stored."]
