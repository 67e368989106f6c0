"""Whether alerts reach people: hooks, and what is owed to them."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from datetime import timedelta

from shm.bridge import AppriseHook, Hook, WebhookHook
from shm.store import Workspace
from shm.store.rows import DeliveryState
from shm_daemon.doctor.contract import Examined, Finding, fault, ok, unknown, warning
from shm_daemon.heartbeat import told
from shm_daemon.hooks import HookFailed, HookNotifier

_LATE = timedelta(minutes=10)
_REMEMBERED = timedelta(days=30)


def check_hooks(workspace: Workspace) -> Iterator[Finding]:
    """Whether the described hooks could be run; nothing is sent. Needs no store."""
    if not workspace.bridge.hooks:
        yield warning("hooks", "none is described: nobody is told of alerts", "See docs/alerts.md.")
    timeout_s = workspace.settings.hook_timeout_seconds
    notifier = HookNotifier(workspace.folder, timeout_s, os.environ)
    try:
        for hook in workspace.bridge.hooks:
            yield _ready(notifier, hook)
            yield from _secrecy(workspace, hook)
    finally:
        notifier.close()


def check_deliveries(examined: Examined) -> Iterator[Finding]:
    """Whether alerts wait for their hooks, or were given up."""
    store, now = examined.store, examined.now
    waiting = store.deliveries(DeliveryState.WAITING)
    late = [each for each in waiting if each.attempts or now - each.next_attempt_at > _LATE]
    if late:
        worst = max(late, key=lambda each: each.attempts)
        said = worst.last_error or "not tried yet: is a daemon active?"
        yield warning(
            "deliveries",
            f"{len(late)} alerts have not reached their hook; {worst.hook}, tried "
            f"{worst.attempts} times: {said}",
            f"`shm alerts test --hook {worst.hook}`; they are tried again by themselves.",
        )
    ended = store.deliveries(DeliveryState.GIVEN_UP)
    lost = [each for each in ended if each.ended_at and now - each.ended_at < _REMEMBERED]
    if lost:
        last = lost[-1]
        yield warning(
            "deliveries",
            f"{len(lost)} were given up in the last {told(_REMEMBERED)}; {last.hook}: "
            f"{last.last_error}",
            "See `shm alerts` for what nobody was told of, and mend the hook.",
        )
    if not late and not lost:
        yield ok("deliveries", f"{len(waiting)} on their way" if waiting else "none owed")


def _ready(notifier: HookNotifier, hook: Hook) -> Finding:
    check = f"hook {hook.name}"
    try:
        return ok(check, notifier.ready(hook))
    except HookFailed as error:
        if isinstance(hook, WebhookHook) and hook.secret_env:
            # The daemon's environment may hold what ours does not.
            return unknown(check, error.message, "Try it as the daemon's user, with its variables.")
        return fault(check, error.message, error.remedy)


def _secrecy(workspace: Workspace, hook: Hook) -> Iterator[Finding]:
    name = ""
    if isinstance(hook, WebhookHook):
        name = hook.secret_file
    if isinstance(hook, AppriseHook):
        name = hook.address_file
    path = workspace.folder / name
    if name and path.exists() and path.stat().st_mode & (stat.S_IRGRP | stat.S_IROTH):
        yield warning(f"hook {hook.name}", f"others can read {name}", f"chmod 600 {path}")
