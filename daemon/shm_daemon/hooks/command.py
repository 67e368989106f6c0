"""A hook that is a program of the owner's: it gets the alert as JSON on its standard input. No
shell, a bare environment, a time limit; it is ended with the processes of its session.
"""

from __future__ import annotations

import os
import selectors
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO

from shm.bridge import CommandHook
from shm.documents import dump
from shm.values import Alert, printable
from shm_daemon.hooks.contract import SHOWN_CHARACTERS, DeliveryContext, HookFailed

_PASSED_ON = ("PATH", "HOME", "LANG")


class Processes:
    """Runs programs in the workspace's folder, each in a session of its own."""

    def __init__(self, surroundings: DeliveryContext):
        self.surroundings = surroundings
        self.folder, self._timeout_s = surroundings.folder, surroundings.timeout_s
        given = surroundings.environment
        self._environment = {name: given[name] for name in _PASSED_ON if name in given}
        self._running: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()
        self._closed = False

    def run(self, command: Sequence[str], message: bytes, variables: Mapping[str, str]) -> str:
        """Run a program with ``message`` on its standard input; return the end of its stdout.

        When it ends, or its time is over, the processes of its session are ended. Raises
        HookFailed with the end of what it wrote on stderr.
        """
        process = self._begin(command, variables)
        latest = time.monotonic() + self._timeout_s
        try:
            answer, errors = exchange(process, message, self._timeout_s)
            # Its streams end before it does: killed in between, it would have no exit code.
            process.wait(max(latest - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            raise HookFailed(
                f"ended after {self._timeout_s:g} s.",
                remedy="Make it quicker, or raise hook_timeout_seconds.",
            ) from None
        finally:
            self._end(process)
        if process.returncode != 0:
            raise HookFailed(
                f"exit code {process.returncode}: {_show_end(errors) or 'no message'}",
                remedy="See what its program needs, then try `shm alerts test`.",
            )
        return _show_end(answer)

    def close(self) -> None:
        """End running programs; what they were to deliver is delivered again."""
        with self._lock:
            self._closed = True
            for process in self._running:
                _kill_session(process)

    def _begin(
        self, command: Sequence[str], variables: Mapping[str, str]
    ) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._closed:
                raise HookFailed("not begun: the daemon is ending.")
            try:
                process = subprocess.Popen(  # noqa: S603 - the owner's own command, no shell
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    bufsize=0,
                    cwd=self.folder,
                    env={**self._environment, **variables},
                    start_new_session=True,
                )
            except (OSError, ValueError) as error:
                raise HookFailed(f"cannot be run: {error}.", remedy="Check its path.") from error
            self._running.add(process)
            return process

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        with self._lock:
            _kill_session(process)
            self._running.discard(process)
        for stream in (process.stdin, process.stdout, process.stderr):
            if stream is not None:
                stream.close()
        process.wait()


def _kill_session(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def exchange(
    process: subprocess.Popen[bytes], message: bytes, timeout_s: float, max_bytes: int = 64 * 1024
) -> tuple[bytes, bytes]:
    """Write ``message`` to a process; return the last ``max_bytes`` of its stdout and stderr.

    Both are read until the process ends, so that it never waits for a reader and needs no disk.
    Raises TimeoutExpired.
    """
    if process.stdin is None or process.stdout is None or process.stderr is None:
        raise TypeError("a process with three pipes is needed")
    latest = time.monotonic() + timeout_s
    output: dict[IO[bytes], bytes] = {process.stdout: b"", process.stderr: b""}
    streams = {each.fileno(): each for each in (process.stdin, *output)}
    with selectors.DefaultSelector() as waiting:
        for number, stream in streams.items():
            os.set_blocking(number, False)
            writes = stream is process.stdin
            waiting.register(number, selectors.EVENT_WRITE if writes else selectors.EVENT_READ)
        while waiting.get_map():
            left_s = latest - time.monotonic()
            if left_s <= 0:
                raise subprocess.TimeoutExpired(process.args, timeout_s)
            ended = process.poll() is not None
            # A process of another session may live on and hold a stream open: look now and then.
            ready = waiting.select(0 if ended else min(left_s, 0.5))
            if ended and not ready:
                break
            for key, _ in ready:
                stream = streams[key.fd]
                if stream is process.stdin:
                    message = message[_write(stream, message) :]
                    more = bool(message)
                else:
                    read = stream.read(max_bytes)
                    output[stream] = (output[stream] + read)[-max_bytes:]
                    more = bool(read)
                if not more:
                    waiting.unregister(key.fd)
                    stream.close()
    return output[process.stdout], output[process.stderr]


class CommandDeliverer(Processes):
    """Runs the command for each alert; an exit code of 0 says that it is delivered."""

    def __call__(self, hook: CommandHook, alert: Alert) -> str:
        """Runs the command; raises HookFailed with what it wrote."""
        message = dump(self.surroundings.document(alert)).encode()
        answer = self.run(hook.command, message, {"SHM_ALERT_KEY": alert.key})
        return f"exit code 0: {answer}" if answer else "exit code 0"

    def ready(self, hook: CommandHook) -> str:
        """The program; raises HookFailed where it is not there or cannot be run."""
        program = hook.command[0]
        candidate = self.folder / program if "/" in program else program
        found = shutil.which(candidate, path=self._environment.get("PATH"))
        if found is None:
            raise HookFailed(
                f"{program} is not there, or cannot be run.",
                remedy="Check its path, and that it may be executed.",
            )
        return str(found)


def _write(stream: IO[bytes], message: bytes) -> int:
    """Write what a pipe has room for; all of it where nobody reads."""
    try:
        return stream.write(message) or 0
    except BrokenPipeError:
        return len(message)


def _show_end(written: bytes) -> str:
    """Return the end of what a program wrote, fit for one line of a log."""
    text = printable(written.decode(errors="replace"), " ")
    return " ".join(text.split())[-SHOWN_CHARACTERS:]
