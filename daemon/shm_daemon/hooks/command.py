"""A hook that is a program of the owner's: it gets the alert as JSON on its standard input. No
shell, a bare environment, a time limit; it is ended with all its children.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Mapping, Sequence
from typing import IO

from shm.bridge import CommandHook
from shm.documents import alert_document, dump
from shm.values import Alert
from shm_daemon.hooks.contract import SHOWN_CHARACTERS, HookFailed, Surroundings, one_line

_PASSED_ON = ("PATH", "HOME", "LANG")


class Processes:
    """Runs programs in the workspace's folder, each in a process group of its own."""

    def __init__(self, surroundings: Surroundings):
        self.folder, self._timeout_s = surroundings.folder, surroundings.timeout_s
        given = surroundings.environment
        self._environment = {name: given[name] for name in _PASSED_ON if name in given}
        self._running: set[int] = set()
        self._lock = threading.Lock()
        self._closed = False

    def run(self, command: Sequence[str], told: bytes, variables: Mapping[str, str]) -> str:
        """Runs a program with `told` on its standard input; the end of what it wrote on stdout.

        Raises HookFailed with the end of what it wrote on stderr.
        """
        with tempfile.TemporaryFile() as answer, tempfile.TemporaryFile() as errors:
            process = self._begin(command, variables, answer, errors)
            try:
                process.communicate(told, self._timeout_s)
            except subprocess.TimeoutExpired:
                raise HookFailed(
                    f"ended after {self._timeout_s:g} s.",
                    remedy="Make it quicker, or raise hook_timeout_seconds.",
                ) from None
            finally:
                self._end(process)
            if process.returncode != 0:
                said = _tail(errors) or "no message"
                raise HookFailed(
                    f"exit code {process.returncode}: {said}",
                    remedy="See what its program needs, then try `shm alerts test`.",
                )
            return _tail(answer)

    def close(self) -> None:
        """Ends running programs; what they were to deliver is delivered again."""
        with self._lock:
            self._closed = True
            for group in self._running:
                _kill(group)

    def _begin(
        self,
        command: Sequence[str],
        variables: Mapping[str, str],
        answer: IO[bytes],
        errors: IO[bytes],
    ) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._closed:
                raise HookFailed("not begun: the daemon is ending.")
            try:
                process = subprocess.Popen(  # noqa: S603 - the owner's own command, no shell
                    command,
                    stdin=subprocess.PIPE,
                    stdout=answer,
                    stderr=errors,
                    cwd=self.folder,
                    env={**self._environment, **variables},
                    start_new_session=True,
                )
            except (OSError, ValueError) as error:
                raise HookFailed(f"cannot be run: {error}.", remedy="Check its path.") from error
            self._running.add(process.pid)
            return process

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        """Ends the whole process group of a program that has not come to an end by itself."""
        with self._lock:
            if process.returncode is None:
                _kill(process.pid)
            self._running.discard(process.pid)
        process.wait()
        if process.stdin is not None:
            process.stdin.close()


class CommandDeliverer(Processes):
    """Runs the command for each alert; an exit code of 0 says that it is delivered."""

    def __call__(self, hook: CommandHook, alert: Alert) -> str:
        """Runs the command; raises HookFailed with what it wrote."""
        told = dump(alert_document(alert)).encode()
        answer = self.run(hook.command, told, {"SHM_ALERT_KEY": alert.key})
        return f"exit code 0: {answer}" if answer else "exit code 0"

    def ready(self, hook: CommandHook) -> str:
        """The program; raises HookFailed where it is not there or cannot be run."""
        program = hook.command[0]
        beside = self.folder / program if "/" in program else program
        found = shutil.which(beside, path=self._environment.get("PATH"))
        if found is None:
            raise HookFailed(
                f"{program} is not there, or cannot be run.",
                remedy="Check its path, and that it may be executed.",
            )
        return str(found)


def _kill(group: int) -> None:
    try:
        os.killpg(group, signal.SIGKILL)
    except ProcessLookupError:
        return


def _tail(written: IO[bytes]) -> str:
    size = written.seek(0, os.SEEK_END)
    written.seek(max(0, size - SHOWN_CHARACTERS))
    return one_line(written.read().decode(errors="replace"))
