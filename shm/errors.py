"""The error tree. Each message says what is wrong, where, and what to do.

ShmError                      exit code 1
├── UsageError                2   the call itself is off
├── BadInput                  3   a file, channel, line or value that cannot be used
│   ├── NotIdentifiable       3   a readable recording in which no mode can be trusted
│   ├── NotDescribed          4   a hanger or stream that bridge.toml does not describe
│   ├── TooLarge              3   more bytes than are taken
│   └── DoubledChunk          3   another chunk of a stream has its number and time
├── NothingThere              4   a right question that has no answer yet
├── WorkerDied                1   a process died that worked on a file, perhaps not because of it
├── StoreError                5   the store cannot be used
│   ├── SchemaOutdated        5   mend: `shm db upgrade`
│   ├── StoreDamaged          5   its bytes are not those that were written
│   └── StoreBusy             5   passing: try again after `retry_after_s`
└── GateNotMet                6   a validation or a blind trial missed its mark
"""

from __future__ import annotations

import difflib
import errno
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path

DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
"""Codes of an OSError where a disk, or the share of it that one may use, is full."""


def sentence(text: str) -> str:
    """Return the text with exactly one full stop at its end."""
    text = text.rstrip()
    return text if text.endswith(("?", "!", "...")) else f"{text.rstrip('.')}."


class ShmError(Exception):
    """Base of all errors that shm raises on purpose.

    `remedy` says what to do; `retry_after_s` is None where trying again cannot help.
    """

    exit_code = 1

    def __init__(self, message: str, *, remedy: str = "", retry_after_s: float | None = None):
        if message.endswith(".."):  # what it quotes had its own full stop
            message = sentence(message)
        super().__init__(message)
        self.message = message
        self.remedy = remedy
        self.retry_after_s = retry_after_s

    @property
    def where(self) -> str:
        """File, channel and line of the fault, as far as they are known."""
        return ""

    def __str__(self) -> str:
        where = f"{self.where}: " if self.where else ""
        remedy = f" {self.remedy}" if self.remedy else ""
        return f"{where}{self.message}{remedy}"


def retry_pause_s(error: BaseException, otherwise_s: float) -> float:
    """Return the pause that an error asks for before the next try, else another."""
    return getattr(error, "retry_after_s", None) or otherwise_s


class UsageError(ShmError):
    """The command or call was put together wrongly."""

    exit_code = 2


class BadInput(ShmError):
    """A file or value that cannot be used, with the place of the fault."""

    exit_code = 3

    def __init__(
        self,
        message: str,
        *,
        file: str | Path = "",
        channel: str = "",
        line: int | None = None,
        remedy: str = "",
    ):
        super().__init__(message, remedy=remedy)
        self.file = str(file)
        self.channel = channel
        self.line = line

    @property
    def where(self) -> str:
        parts = [Path(self.file).name if self.file else ""]
        parts.append(f"line {self.line}" if self.line is not None else "")
        parts.append(f"channel {self.channel}" if self.channel else "")
        return ", ".join(part for part in parts if part)


class NotIdentifiable(BadInput):
    """A recording that reads well but holds no mode that can be trusted."""


class NotDescribed(BadInput):
    """A hanger, structure or stream that `bridge.toml` does not describe."""

    exit_code = 4


class TooLarge(BadInput):
    """A file of more bytes than are taken; it is neither copied nor read."""


class DoubledChunk(BadInput):
    """A chunk of a stream with the number and the time of one that is kept, and other samples."""


class NothingThere(ShmError):
    """Nothing has been stored yet that answers the question."""

    exit_code = 4


class WorkerDied(ShmError):
    """A process that worked on a file died, by itself or killed; `how`: signal or exit code."""

    def __init__(self, message: str, *, how: str = ""):
        super().__init__(message, remedy="It is tried again.")
        self.how = how


class StoreError(ShmError):
    """The store cannot be opened, read or written."""

    exit_code = 5


class SchemaOutdated(StoreError):
    """The store was written by another version of shm."""


class StoreDamaged(StoreError):
    """The store holds other bytes than were written into it."""


class StoreBusy(StoreError):
    """Another process holds the store; trying again helps."""


class GateNotMet(ShmError):
    """A measured figure missed the mark that was set for it."""

    exit_code = 6


def suggest(name: str, known: Iterable[str]) -> str:
    """Return `Did you mean diameter_m? ` for a misspelt name, or "" if no known name is near."""
    by_lower = {each.lower(): each for each in known}
    near = difflib.get_close_matches(name.lower(), list(by_lower), n=1)
    return f"Did you mean {by_lower[near[0]]}? " if near else ""


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Says which extra to install where an import in this context fails."""
    try:
        yield
    except ImportError as error:
        raise UsageError(
            f"{error.name or 'a library'} is not installed.",
            remedy=f"Install it with `pip install 'shm[{extra}]'`.",
        ) from error


def check_count(name: str, given: object, usual: int, least: int = 1) -> None:
    """Raise UsageError if `given` is no whole number from `least` on."""
    if not isinstance(given, Integral) or isinstance(given, bool) or given < least:
        raise UsageError(
            f"{name} is {given!r}, not a whole number of at least {least}.",
            remedy=f"Leave it out, or write {name}={usual}.",
        )
