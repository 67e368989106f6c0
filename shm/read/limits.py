"""State how much one file may hold, checked before memory is allocated.

Errors that a library's parser raises on damaged files become one refusal here, too.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shm.errors import BadInput, ShmError
from shm.settings import Settings

_SPLIT = "Split the record, or leave out what is not needed."


@dataclass(frozen=True)
class Limits:
    """Limit what one file may hold and what reading it may cost; each is a setting of its name.

    `max_channels` are accelerations, `max_samples` those of one channel (or lines of a
    frequency response), `max_header_bytes` the text before the numbers of a file, and a
    sidecar.
    """

    max_channels: int = Settings.max_channels
    max_samples: int = Settings.max_samples
    max_header_bytes: int = Settings.max_header_bytes
    parse_seconds: float = Settings.parse_seconds
    parse_memory_bytes: int = Settings.parse_memory_bytes

    @property
    def bytes_at_once(self) -> int:
        """The largest file, unpacked content and array: readers hold up to four copies."""
        return self.parse_memory_bytes // 4

    @property
    def values_at_once(self) -> int:
        """Return the largest number of values in double precision that may be in memory."""
        return self.bytes_at_once // 8


_in_force: ContextVar[Limits] = ContextVar("limits", default=Limits())  # noqa: B039 - frozen


def limits() -> Limits:
    """Return the limits that apply to reading now."""
    return _in_force.get()


@contextmanager
def limited(to: Limits) -> Iterator[None]:
    """Put limits in force for the context."""
    before = _in_force.set(to)
    try:
        yield
    finally:
        _in_force.reset(before)


def refuse_large(shape: Sequence[int], item_bytes: int, what: str, path: Path) -> None:
    """Raise BadInput where an array of this shape would outgrow the memory available to it."""
    most = limits().bytes_at_once
    if any(length < 0 for length in shape) or math.prod(shape) * item_bytes > most:
        size = "x".join(str(length) for length in shape)[:80]
        raise BadInput(
            f"holds {size} values, beyond the {most >> 20} MB that are read at once.",
            file=path,
            channel=what,
            remedy=_SPLIT,
        )


def refuse_many_samples(samples: int, path: Path) -> None:
    """Raise BadInput for a record longer than the setting max_samples."""
    if samples > limits().max_samples:
        raise BadInput(
            f"{samples} samples are more than the {limits().max_samples} of setting max_samples.",
            file=path,
            remedy="Split the record, or raise the setting.",
        )


def refuse_long_header(size_bytes: int, path: Path) -> None:
    """Raise BadInput for a heading or sidecar beyond the setting max_header_bytes."""
    if size_bytes > limits().max_header_bytes:
        raise BadInput(
            f"{size_bytes} bytes say what the numbers are, more than the"
            f" {limits().max_header_bytes} of setting max_header_bytes.",
            file=path,
            remedy="Shorten the header: a line of names, then a row a line; or raise the setting.",
        )


def too_large(path: Path) -> BadInput:
    """Return the refusal of a file that is, or unpacks to, more than may be read at once."""
    return BadInput(
        f"holds more than the {limits().bytes_at_once >> 20} MB that are read at once.",
        file=path,
        remedy=_SPLIT,
    )


def too_much_memory(path: Path, what: str) -> BadInput:
    """Return the refusal of a file that makes its reader ask for more memory than it has."""
    return BadInput(
        f"{what} needs more memory than is given to one file.",
        file=path,
        remedy="Export a small file again; split a long one, or raise parse_memory_bytes.",
    )


@contextmanager
def guarded(path: Path, what: str = "the file") -> Iterator[None]:
    """Turn errors and warnings of a parser within the context into a BadInput."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("error")
            yield
    except ShmError:
        raise
    except MemoryError as error:
        raise too_much_memory(path, what) from error
    except Exception as error:
        raise BadInput(
            f"{what} cannot be read: its structure is damaged or of an unknown kind.",
            file=path,
            remedy="Export or send it again.",
        ) from error
