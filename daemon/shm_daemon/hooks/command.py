"""A hook that is a program of the owner's: it gets the alert as JSON on its standard input."""

from __future__ import annotations

from shm.bridge import CommandHook
from shm.documents import alert_document, dump
from shm.values import Alert
from shm_daemon.hooks.contract import Surroundings
from shm_daemon.hooks.processes import Processes


class CommandDeliverer:
    """Runs the command for each alert; an exit code of 0 says that it is delivered."""

    def __init__(self, surroundings: Surroundings):
        self._processes = Processes(surroundings)

    def __call__(self, hook: CommandHook, alert: Alert) -> str:
        """Runs the command; raises HookFailed with what it wrote."""
        told = dump(alert_document(alert)).encode()
        answer = self._processes.run(hook.command, told, {"SHM_ALERT_KEY": alert.key})
        return f"exit code 0: {answer}" if answer else "exit code 0"

    def ready(self, hook: CommandHook) -> str:
        """The program; raises HookFailed where it is not there or cannot be run."""
        return self._processes.find(hook.command[0])

    def close(self) -> None:
        self._processes.close()
