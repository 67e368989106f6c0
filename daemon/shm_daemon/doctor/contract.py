"""What a check finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from shm.store import Store, Workspace


class Level(StrEnum):
    """How a finding is to be taken; `unknown` is what could not be looked at."""

    OK = "ok"
    UNKNOWN = "unknown"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """What one check found, and what to do where that is not well."""

    check: str
    level: Level
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class Examined:
    """What the checks look at: an open workspace with its open store, and the time."""

    workspace: Workspace
    store: Store
    now: datetime


Check = Callable[[Examined], Iterator[Finding]]
"""A check of a store that can be read; it may raise ShmError and OSError, which become findings."""


def ok(check: str, found: str) -> Finding:
    """All is well."""
    return Finding(check, Level.OK, found)


def warning(check: str, found: str, remedy: str) -> Finding:
    """Work goes on; somebody should look."""
    return Finding(check, Level.WARNING, found, remedy)


def fault(check: str, found: str, remedy: str) -> Finding:
    """Work cannot go on as it should."""
    return Finding(check, Level.FAULT, found, remedy)


def unknown(check: str, found: str, remedy: str = "") -> Finding:
    """It could not be looked at."""
    return Finding(check, Level.UNKNOWN, found, remedy)


def some(names: list[str], most: int = 5) -> str:
    """The first of many names."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
