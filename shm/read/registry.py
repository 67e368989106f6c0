"""The formats that are known, and the verbs for a single file: reading, a look at its headers, and
a survey of all its columns before it is known which of them is what.

A whole test: one file, or all files of an archive; a document of modal tests with the sidecar
beside it, which goes before it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from shm import modes_document
from shm.errors import BadInput, UsageError
from shm.read import logger_text
from shm.read import logger_words as words
from shm.read.assemble import read_of_test
from shm.read.base import (
    Format,
    Layout,
    LoggerColumn,
    LoggerTable,
    Peek,
    PeekChannel,
    Survey,
    SurveyedColumn,
)
from shm.read.bundles import each_member, entries_of_test, holds_test
from shm.read.comma_separated import FORMAT as CSV
from shm.read.content import (
    head_of,
    is_gzipped,
    refuse_unless_readable,
    refuse_unreadable_suffix,
)
from shm.read.excel_file import FORMAT as EXCEL
from shm.read.hdf5_file import FORMAT as HDF5
from shm.read.header import CHANNEL_KEYS, Header
from shm.read.matlab_file import FORMAT as MATLAB
from shm.read.mini_seed_file import FORMAT as MINI_SEED
from shm.read.numpy_file import FORMAT as NUMPY
from shm.read.sidecar import document_beside, sidecar_path
from shm.read.tdms_file import FORMAT as TDMS
from shm.read.universal_file import FORMAT as UFF
from shm.read.wave_file import FORMAT as WAVE
from shm.values import Channel, FloatArray, FrequencyResponse, ModalTest, Recording

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


T = TypeVar("T")
Found = TypeVar("Found", bound=Recording | FrequencyResponse | Peek | ModalTest)


def read_test(path: Path) -> tuple[Recording | FrequencyResponse, ...]:
    """The files of one test: all of a .zip, in the order of their names, else the one file."""
    if not holds_test(path):
        return (read(path),)
    head_of(path)
    records = each_member(path, lambda file, name: replace(_named(read, file, name), source=name))
    return tuple(_as_said(record, entries_of_test(path).of_test) for record in records)


def peek_test(path: Path) -> tuple[Peek, ...]:
    """What the headers of each file of a test say; members not readable have that as problem."""
    if not holds_test(path):
        return (peek(path),)
    head_of(path)
    problems: list[str] = []
    said = read_of_test(entries_of_test(path), problems)
    looks = (_as_said(found, said) for found in each_member(path, _peek_member))
    return tuple(replace(look, problems=(*look.problems, *problems)) for look in looks)


def _peek_member(file: Path, name: str) -> Peek:
    try:
        return replace(_named(peek, file, name), source=name)
    except BadInput as refusal:
        return Peek(name, "not readable", (), 0, problems=(str(refusal),))


def _named(verb: Callable[[Path], T], file: Path, name: str) -> T:
    """What `verb` gives; its refusals name the member of the archive, not where it was unpacked."""
    try:
        return verb(file)
    except BadInput as refusal:
        inside = Path(name).with_name(Path(refusal.file or name).name)
        raise BadInput(
            refusal.message,
            file=inside,
            channel=refusal.channel,
            line=refusal.line,
            remedy=refusal.remedy,
        ) from refusal


def load_modes(path: Path) -> tuple[ModalTest, ...]:
    """The tests of a `*.modes.json` file; raises BadInput with file, test, mode and remedy.

    Hanger, time, temperature and the known mass of a sidecar are those of its tests.
    """
    tests = modes_document.load_modes(path)
    _refuse_channels(path)
    said = entries_of_test(path)
    _refuse_what_samples_have(said, tests, path)
    return tuple(_as_said(test, said.of_test) for test in tests)


def _as_said(found: Found, said: Mapping[str, Any]) -> Found:
    """Return a test with what a sidecar says of all of it; None and NaN change nothing."""
    known = {key: value for key, value in said.items() if value is not None and value == value}
    return replace(found, **known)


def _refuse_channels(path: Path) -> None:
    for key in document_beside(path).keys() & {"channel", *CHANNEL_KEYS}:
        raise BadInput(
            f"{key!r} is said of modes, which have no channels.",
            file=sidecar_path(path),
            remedy=f"Say hanger, time and temperature_c here, all else in {path.name}.",
        )


def _refuse_what_samples_have(said: Header, tests: tuple[ModalTest, ...], path: Path) -> None:
    sidecar = sidecar_path(path)
    if not math.isnan(said.sampling_rate_hz):
        raise BadInput(
            "sampling_rate_hz is said of modes, whose frequencies are known.",
            file=sidecar,
            remedy=f"Correct the frequencies in {path.name} and send it again.",
        )
    if said.time is not None and len(tests) > 1:
        raise BadInput(
            f"one time is said of {len(tests)} tests.",
            file=sidecar,
            remedy=f"Give each test its own time in {path.name}.",
        )


_FINGERPRINT_DIGITS = 16  # technical: of 64 bits; a workspace has a handful of loggers


def survey(path: Path) -> Survey:
    """All that can be found out about a file; raises BadInput where that is nothing."""
    _refuse_archive(path)
    found = format_of(path)
    table = found.table(path) if found.table else None
    look = (
        logger_text.peeked(table, found.name, path)
        if table is not None and table.is_text
        else found.peek(path)
    )
    known = {channel.name: channel for channel in look.channels}
    if table is None:
        listed = look.channels if look.lines else ()
        columns: Sequence[SurveyedColumn] = [_bare(channel) for channel in listed]
    else:
        columns = [_column(column, known.get(column.name)) for column in table.columns]
    return Survey(
        source=str(path),
        format=found.name,
        columns=tuple(columns),
        samples=look.samples or (table.samples if table is not None else 0),
        sampling_rate_hz=look.sampling_rate_hz,
        hanger=look.hanger,
        time=look.time,
        temperature_c=look.temperature_c,
        layout=_layout(found, table, look),
        lines=look.lines,
        remarks=table.remarks if table is not None else (),
        problems=(*look.problems, *_left_out(look, columns)),
    )


def layout_of(path: Path) -> Layout:
    """The layout of a file alone; raises BadInput where nothing can be made out."""
    return survey(path).layout


def _left_out(look: Peek, columns: Sequence[SurveyedColumn]) -> tuple[str, ...]:
    """What a file holds that is not read, where that is all that it holds."""
    if columns or not look.left_out:
        return ()
    return (f"it holds {', '.join(look.left_out)[:200]}, which is not read.",)


def _refuse_archive(path: Path) -> None:
    if holds_test(path):
        raise BadInput(
            "is an archive of several files.",
            file=path,
            remedy="Unpack it and import one of its files; those of the same logger need nothing"
            " then.",
        )


def _column(column: LoggerColumn, known: PeekChannel | None) -> SurveyedColumn:
    meant = words.quantity_meant(column.name)
    plane = words.plane_meant(column.name)
    if known is None:
        return SurveyedColumn(
            column.name, column.unit, column.values, column.overloads, None, meant, plane
        )
    return SurveyedColumn(
        column.name, column.unit, column.values, column.overloads, known.quantity, meant,
        known.plane or (plane if known.quantity == "acceleration" else None),
        known.x_m, known.calibration, known.full_scale, known.unit,
    )  # fmt: skip


def _bare(channel: PeekChannel) -> SurveyedColumn:
    return SurveyedColumn(
        channel.name, channel.unit, None, 0, channel.quantity, channel.quantity, channel.plane,
        channel.x_m, channel.calibration, channel.full_scale, channel.unit,
    )  # fmt: skip


def _layout(found: Format, table: LoggerTable | None, look: Peek) -> Layout:
    said = table.layout if table is not None else tuple(c.name for c in look.channels)
    digest = hashlib.sha256("\n".join((found.name, *said)).encode()).hexdigest()
    columns = (
        tuple(f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns)
        if table is not None
        else said
    )
    return Layout(
        digest[:_FINGERPRINT_DIGITS],
        found.name,
        columns,
        table.hanger if table is not None else look.hanger,
        table is not None and (table.said_rate_hz > 0 or table.times_rate_hz > 0),
        table.day_order if table is not None else None,
        table.possible_times if table is not None else (),
    )
