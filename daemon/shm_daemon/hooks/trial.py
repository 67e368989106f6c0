"""A test alert to one hook: whether its notifications arrive, before one is needed."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from shm.bridge import Bridge, Hook
from shm.documents import format_time
from shm.errors import NothingThere
from shm.store import Workspace
from shm.store.journal import Actor
from shm.values import Alert
from shm_daemon.hooks import HookNotifier


@dataclass(frozen=True)
class Trial:
    """Hold the answer of a hook to a test alert, and its seconds."""

    alert: Alert
    answer: str
    seconds: float

    def sentence(self, hook: Hook) -> str:
        """Return that it arrived, and what the hook answered, unless that is the document again."""
        answer = self.answer.partition(": {")[0]
        return f"The hook {hook.name} took the test alert in {self.seconds:.1f} s: {answer}."


def send_test_alert(
    workspace: Workspace,
    hook: Hook,
    environment: Mapping[str, str],
    now: datetime,
    actor: Actor | None = None,
) -> Trial:
    """Send a test alert once, the way of every alert, and keep it in the audit log alone.

    `actor` is who asked; left out, that of the workspace. Raises HookFailed or DeliveryRefused
    where it did not arrive, NothingThere without a hanger.
    """
    alert = make_test_alert(workspace.bridge, hook, now)
    settings, began = workspace.settings, time.monotonic()
    notifier = HookNotifier(
        workspace.folder, settings.hook_timeout_seconds, environment, settings.pages_address
    )
    outcome = "it did not arrive"
    try:
        answer = notifier(hook, alert)
        outcome = "it arrived"
    finally:
        notifier.close()
        with workspace.store() as store:
            acting = store.acting_as(actor) if actor else store
            acting.journal.note(now, "hook tested", hook.name, outcome)
    return Trial(alert, answer, time.monotonic() - began)


def make_test_alert(bridge: Bridge, hook: Hook, now: datetime) -> Alert:
    """Return an alert that says it is none, of the bridge's first hanger; raise NothingThere."""
    if not bridge.hangers:
        raise NothingThere(
            "bridge.toml describes no hanger.", remedy="Describe one: an alert is of a hanger."
        )
    hanger = bridge.hangers[0].id
    message = (
        f"This is a test of the hook {hook.name} of {bridge.name}. Nothing has happened to hanger "
        f"{hanger} or any other."
    )
    key = f"test:{hook.name}:{format_time(now)}"
    return Alert(key, hanger, "", now, message, drifts=(), kinds=("test",))
