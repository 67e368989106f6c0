"""Runs a hook's command for an alert: no shell, a bare environment, a time limit."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import IO

from shm.bridge import Hook
from shm.documents import alert_document, dump
from shm.errors import ShmError
from shm.values import Alert

_PASSED_ON = ("PATH", "HOME", "LANG")
_ERROR_BYTES = 500


class HookFailed(ShmError):
    """A hook could not be run, ran too long, or said that it failed."""


class CommandNotifier:
    """Delivers alerts to hooks; `close` ends, from another thread, those that are running."""

    def __init__(self, folder: Path, timeout_s: float, environment: Mapping[str, str]):
        self._folder, self._timeout_s = folder, timeout_s
        self._environment = {name: environment[name] for name in _PASSED_ON if name in environment}
        self._running: set[int] = set()
        self._lock = threading.Lock()
        self._closed = False

    def __call__(self, hook: Hook, alert: Alert) -> None:
        """Runs the command in the workspace's folder; raises HookFailed with what it wrote."""
        with tempfile.TemporaryFile() as errors:
            process = self._begin(hook, alert, errors)
            try:
                process.communicate(dump(alert_document(alert)).encode(), self._timeout_s)
            except subprocess.TimeoutExpired:
                raise HookFailed(
                    f"ended after {self._timeout_s:g} s.", remedy="Make it quicker."
                ) from None
            finally:
                self._end(process)
            if process.returncode != 0:
                raise HookFailed(f"exit code {process.returncode}: {_tail(errors)}")

    def close(self) -> None:
        """Ends running hooks; what they were to deliver is delivered again."""
        with self._lock:
            self._closed = True
            for group in self._running:
                _kill(group)

    def _begin(self, hook: Hook, alert: Alert, errors: IO[bytes]) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._closed:
                raise HookFailed("not begun: the daemon is ending.")
            try:
                process = subprocess.Popen(  # noqa: S603 - the owner's own command, no shell
                    hook.command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=errors,
                    cwd=self._folder,
                    env={**self._environment, "SHM_ALERT_KEY": alert.key},
                    start_new_session=True,
                )
            except OSError as error:
                raise HookFailed(f"cannot be run: {error}.", remedy="Check its path.") from error
            self._running.add(process.pid)
            return process

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        """Ends the whole process group of a hook that has not come to an end by itself."""
        with self._lock:
            if process.returncode is None:
                _kill(process.pid)
            self._running.discard(process.pid)
        process.wait()
        if process.stdin is not None:
            process.stdin.close()


def _kill(group: int) -> None:
    try:
        os.killpg(group, signal.SIGKILL)
    except ProcessLookupError:
        return


def _tail(errors: IO[bytes]) -> str:
    size = errors.seek(0, os.SEEK_END)
    errors.seek(max(0, size - _ERROR_BYTES))
    return errors.read().decode(errors="replace").strip() or "no message"
