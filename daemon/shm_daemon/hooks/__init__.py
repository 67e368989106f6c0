"""Delivers alerts to hooks. A new kind of hook is a file here and a line in `KINDS`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shm.bridge import AppriseHook, CommandHook, Hook, WebhookHook
from shm.values import Alert
from shm_daemon.hooks.apprise import AppriseDeliverer
from shm_daemon.hooks.command import CommandDeliverer
from shm_daemon.hooks.contract import Deliverer, DeliveryContext, HookFailed
from shm_daemon.hooks.webhook import WebhookDeliverer

__all__ = ["KINDS", "Deliverer", "DeliveryContext", "HookFailed", "HookNotifier"]

KINDS: Mapping[type[Hook], type[Any]] = {
    CommandHook: CommandDeliverer,
    WebhookHook: WebhookDeliverer,
    AppriseHook: AppriseDeliverer,
}


class HookNotifier:
    """Delivers an alert to a hook of any kind; `close` ends, from another thread, what runs."""

    def __init__(
        self,
        folder: Path,
        timeout_s: float,
        environment: Mapping[str, str],
        pages_address: str = "",
    ):
        surroundings = DeliveryContext(folder, timeout_s, environment, pages_address)
        self._deliverers: dict[type[Hook], Deliverer] = {
            kind: made(surroundings) for kind, made in KINDS.items()
        }

    def __call__(self, hook: Hook, alert: Alert) -> str:
        """Delivers; what the hook answered. Raises HookFailed or DeliveryRefused."""
        return self._deliverers[type(hook)](hook, alert)

    def ready(self, hook: Hook) -> str:
        """Return where its alerts would go; raises HookFailed where none could be delivered."""
        return self._deliverers[type(hook)].ready(hook)

    def close(self) -> None:
        """Ends deliveries under way; what they were to deliver is delivered again."""
        for deliverer in self._deliverers.values():
            deliverer.close()
