"""Readers: a file becomes a `Recording` or a `FrequencyResponse`, in SI units, gaps as NaN.

A format is one file and one line of `FORMATS`. Beside a file NAME.csv (or .uff) a sidecar NAME.toml
may say what the file does not: hanger, time, temperature, and each channel's unit, place and plane.
What the sidecar says goes before what the file says.
"""

from __future__ import annotations

from pathlib import Path

from shm.errors import UsageError
from shm.read.base import Format, Peek, PeekChannel
from shm.read.comma_separated import FORMAT as CSV
from shm.read.content import head_of, refuse_unless_readable, refuse_unreadable_suffix
from shm.read.sidecar import sidecar_path
from shm.read.universal_file import FORMAT as UFF
from shm.values import FrequencyResponse, Recording

__all__ = ["FORMATS", "Format", "Peek", "PeekChannel", "peek", "read", "sidecar_path", "write"]

# The most particular first: any text may be comma-separated.
FORMATS: tuple[Format, ...] = (
    UFF,
    CSV,
)


def read(path: Path) -> Recording | FrequencyResponse:
    """The content of a file; raises BadInput naming file, line, channel and remedy."""
    return _format_of_content(path).read(path)


def peek(path: Path) -> Peek:
    """What the headers of a file say, without its data.

    Faults of the description are listed in `problems`; a file of which nothing can be made out
    raises BadInput.
    """
    return _format_of_content(path).peek(path)


def write(recording: Recording | FrequencyResponse, path: Path) -> None:
    """Writes a file in the format of its suffix, whole or not at all.

    A format that cannot hold everything gets a sidecar, written first. Raises UsageError for a
    suffix of no format and for what the format cannot hold.
    """
    found = _format_of_suffix(path)
    if found is None:
        raise UsageError(
            f"no format is written as {path.suffix or 'a file without suffix'}.",
            remedy=f"Use one of {', '.join(_suffixes())}.",
        )
    found.write(recording, path)


def _format_of_content(path: Path) -> Format:
    """The format of the suffix, after a look at the content."""
    head = head_of(path)
    claimed = _format_of_suffix(path)
    recognised = next((known for known in FORMATS if known.recognises(head)), None)
    if claimed is None:
        raise refuse_unreadable_suffix(path, _suffixes(), recognised)
    refuse_unless_readable(path, head, claimed, recognised)
    return claimed


def _format_of_suffix(path: Path) -> Format | None:
    return next((known for known in FORMATS if path.suffix.lower() in known.suffixes), None)


def _suffixes() -> list[str]:
    return [suffix for known in FORMATS for suffix in known.suffixes]
