"""The formats that are known, and the verbs for a single file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from shm.errors import BadInput, UsageError
from shm.read.base import Format, Peek
from shm.read.bundles import holds_test
from shm.read.comma_separated import FORMAT as CSV
from shm.read.content import (
    head_of,
    is_gzipped,
    refuse_unless_readable,
    refuse_unreadable_suffix,
)
from shm.read.excel_file import FORMAT as EXCEL
from shm.read.hdf5_file import FORMAT as HDF5
from shm.read.matlab_file import FORMAT as MATLAB
from shm.read.mini_seed_file import FORMAT as MINI_SEED
from shm.read.numpy_file import FORMAT as NUMPY
from shm.read.tdms_file import FORMAT as TDMS
from shm.read.universal_file import FORMAT as UFF
from shm.read.wave_file import FORMAT as WAVE
from shm.values import Channel, FloatArray, FrequencyResponse, Recording

# The most particular first: any text may be comma-separated.
FORMATS: tuple[Format, ...] = (
    HDF5,
    MATLAB,
    TDMS,
    NUMPY,
    EXCEL,
    WAVE,
    MINI_SEED,
    UFF,
    CSV,
)


def read(path: Path) -> Recording | FrequencyResponse:
    """The content of a file; raises BadInput naming file, line, channel and remedy."""
    return format_of(path).read(path)


def peek(path: Path) -> Peek:
    """What the headers of a file say, without its data.

    Faults of the description are listed in `problems`; a file of which nothing can be made out
    raises BadInput.
    """
    return format_of(path).peek(path)


def write(recording: Recording | FrequencyResponse, path: Path) -> None:
    """Writes a file in the format of its suffix, whole or not at all.

    A format that cannot hold everything gets a sidecar, written first. Raises UsageError for a
    suffix of no format that is written, and for what the format cannot hold.
    """
    found = _format_of_suffix(path)
    if found is None or found.write is None:
        written = ", ".join(known.suffixes[0] for known in FORMATS if known.write)
        raise UsageError(
            f"no format is written as {path.suffix or 'a file without suffix'}.",
            remedy=f"Use one of {written}.",
        )
    found.write(recording, path)


def format_of(path: Path) -> Format:
    """The format of the suffix, after a look at the content; raises BadInput."""
    head = head_of(path)
    if holds_test(path):
        raise BadInput(
            "holds the files of a test, where one file is read.",
            file=path,
            remedy="Unpack it, or ingest the archive as a whole.",
        )
    claimed = _format_of_suffix(_unpacked_name(path))
    recognised = next((known for known in FORMATS if known.recognises(head)), None)
    if claimed is None or (is_gzipped(path) and not claimed.may_be_gzipped):
        raise refuse_unreadable_suffix(path, _suffixes(), recognised)
    refuse_unless_readable(path, head, claimed, recognised)
    return claimed


def _unpacked_name(path: Path) -> Path:
    return path.with_suffix("") if is_gzipped(path) else path


def _format_of_suffix(path: Path) -> Format | None:
    return next((known for known in FORMATS if path.suffix.lower() in known.suffixes), None)


def _suffixes() -> list[str]:
    return [suffix for known in FORMATS for suffix in known.suffixes]


def libraries_for(path: Path) -> tuple[str, ...]:
    """What reading a file loads, by its suffix; an archive may hold any format."""
    claimed = _format_of_suffix(_unpacked_name(path))
    formats = FORMATS if holds_test(path) else (claimed,) if claimed else ()
    return tuple(each.library for each in formats if each.library)


def write_single(recording: Recording, path: Path) -> None:
    """Writes an .npz file, not compressed: its size tells the numbers of samples and channels."""
    write(replace(recording, channels=tuple(map(_single, recording.channels))), path)


def _single(channel: Channel) -> Channel:
    values = channel.values.astype(np.float32)
    return replace(channel, values=cast(FloatArray, values))
