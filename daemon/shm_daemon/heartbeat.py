"""The signs by which others can tell whether the daemon lives: a file, and messages to systemd."""

from __future__ import annotations

import logging
import math
import os
import socket
import time
from contextlib import suppress
from datetime import timedelta

from shm.store import Workspace

HEARTBEAT = "daemon.heartbeat"
"""A file of the workspace that the active daemon touches at each turn."""
LONGEST_REST_S = 2.0
"""How long at most between two signs, whatever there is to do or to wait for."""
_PATIENCE_S = 60.0  # judgement: thirty missed signs; a machine that swaps misses a few
_BEATS_A_WATCHDOG = 3  # sd_watchdog_enabled(3) asks for two at least: one may be late

log = logging.getLogger(__name__)

NEARLY_FULL = 0.1
"""Judgement: of the room that is wanted on a disk; a warning comes ten times earlier."""


def beat(workspace: Workspace) -> None:
    """Shows that the loop of the active daemon went round."""
    with suppress(OSError):  # a full or read-only disk is waited out elsewhere
        (workspace.folder / HEARTBEAT).touch()  # what it says of a failed turn stays
    tell_systemd("READY=1", "WATCHDOG=1", f"STATUS=watching {workspace.spool}")


def turn_failed(workspace: Workspace, why: str) -> None:
    """Leaves for others why the last turn failed; empty once one went well."""
    with suppress(OSError):
        (workspace.folder / HEARTBEAT).write_text(why, encoding="utf-8")


def why_turn_failed(workspace: Workspace) -> str:
    """Return why the daemon's last turn failed; empty where it went well."""
    try:
        return (workspace.folder / HEARTBEAT).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""


class Pulse:
    """Beats where that is due, however often it is asked; for what takes long, piece by piece."""

    def __init__(self, workspace: Workspace):
        self._workspace, self._beaten_at = workspace, -math.inf

    def __call__(self) -> None:
        if time.monotonic() - self._beaten_at > LONGEST_REST_S / 2:
            self.beat()

    def beat(self) -> None:
        beat(self._workspace)
        self._beaten_at = time.monotonic()


def tell_systemd(*lines: str) -> None:
    """Tells systemd how the service is, where it asked to be told (sd_notify(3)); else nothing.

    READY=1 may be said again and again.
    """
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    if address.startswith("@"):  # a name that is no file
        address = "\0" + address[1:]
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as line:
            line.settimeout(1.0)
            line.sendto("\n".join(lines).encode(), address)
    except OSError as error:
        log.debug("systemd cannot be told: %s", error)


def longest_wait_s() -> float:
    """Return the longest rest between two signs: systemd ends a service that gives none."""
    limit_us = os.environ.get("WATCHDOG_USEC", "")
    asked_s = int(limit_us) / 1e6 / _BEATS_A_WATCHDOG if limit_us.isdecimal() else math.inf
    return min(asked_s, LONGEST_REST_S)


def seconds_since_beat(workspace: Workspace) -> float | None:
    """Return how long ago the loop last went round; None where it never did."""
    try:
        return max(0.0, time.time() - (workspace.folder / HEARTBEAT).stat().st_mtime)
    except OSError:
        return None


def patience_s(workspace: Workspace) -> float:
    """After so long without a sign the daemon is taken to be down, or stuck."""
    return _PATIENCE_S + 2 * workspace.settings.spool_scan_seconds


def duration_words(age: timedelta) -> str:
    """Return a duration in words: `3 d`, `5 h`, `12 min`, `7 s`."""
    seconds = age.total_seconds()
    for size, unit in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
