"""A hook that is mail, chat or a pager, by the library apprise, in a process of its own.

The library has no time limit that holds for all services and cannot be broken off; a process can.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from shm.bridge import AppriseHook
from shm.bridge.hooks import apprise_scheme
from shm.values import Alert
from shm_daemon.hooks.command import Processes
from shm_daemon.hooks.contract import HookFailed, one_line, read_secret, without_code

_SENDER = Path(__file__).with_name("apprise_sender.py")


class AppriseDeliverer(Processes):
    """Sends each alert to all addresses of the hook; it is delivered when each of them took it."""

    def __call__(self, hook: AppriseHook, alert: Alert) -> str:
        """Sends the alert; raises HookFailed naming the services that did not take it."""
        addresses, schemes = self._where(hook)
        # By standard input, as arguments are seen by everyone on the machine. -P: this folder
        # holds a module of the library's name.
        command = [sys.executable, "-P", str(_SENDER)]
        self.run(command, _request(alert, addresses, self.surroundings.link(alert)), {})
        return f"taken by {', '.join(schemes)}"

    def ready(self, hook: AppriseHook) -> str:
        """The services; raises HookFailed where one or the library is missing."""
        return ", ".join(self._where(hook)[1])

    def _where(self, hook: AppriseHook) -> tuple[tuple[str, ...], list[str]]:
        """The addresses and their schemes, the only part that may be told."""
        addresses = hook.addresses or self._addresses(hook)
        schemes = [_allowed(address) for address in addresses]
        if find_spec("apprise") is None:
            raise HookFailed(
                "the library apprise is not installed.", remedy="Run `pip install 'shm[alerts]'`."
            )
        return addresses, schemes

    def _addresses(self, hook: AppriseHook) -> tuple[str, ...]:
        text = read_secret(self.folder, hook.address_file, HookFailed)
        lines = (line.strip() for line in text.splitlines())
        found = tuple(line for line in lines if line and not line.startswith("#"))
        if not found:
            raise HookFailed(f"{hook.address_file} is empty.", remedy="Write an address a line.")
        return found


def _allowed(address: str) -> str:
    try:
        return apprise_scheme(address)
    except ValueError as error:
        raise HookFailed(f"{error}.", remedy="See docs/alerts.md for those that do.") from None


def _request(alert: Alert, addresses: Sequence[str], link: str) -> bytes:
    test, resolved = "test" in alert.kinds, "resolved" in alert.kinds
    title = f"shm: {len(alert.alerts)} hangers" if alert.alerts else f"shm: hanger {alert.hanger}"
    message = without_code(alert.message)
    body = f"{message}\n\nTest {alert.test} of {alert.time:%Y-%m-%d %H:%M} UTC."
    document = {
        "addresses": list(addresses),
        "title": one_line(
            "shm: test of a hook" if test else f"{title}{': resolved' if resolved else ''}"
        ),
        "body": "\n".join([message if test else body, *filter(None, [link]), f"Key: {alert.key}"]),
        "type": "info" if test else "success" if resolved else "warning",
    }
    return json.dumps(document).encode()
