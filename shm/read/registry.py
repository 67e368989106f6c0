"""Hold the known formats and the verbs for a file: read, peek at headers, survey all columns.

A complete test is one file, or all files of an archive. A sidecar of a document of modal tests
overrides the document.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from shm import modes_document
from shm.errors import BadInput, UsageError
from shm.read import (
    comma_separated,
    excel_file,
    hdf5_file,
    labview_file,
    logger_text,
    matlab_file,
    numpy_file,
    sep005,
    tdms_file,
)
from shm.read import logger_words as words
from shm.read.array_reading import format_of_arrays
from shm.read.assemble import assemble, collecting, look_at, read_of_test, sampling_rate
from shm.read.base import Format, Layout, Peek, PeekChannel, Survey, SurveyedColumn, at_once
from shm.read.bundles import each_member, entries_of_test
from shm.read.campbell_file import FORMAT as CAMPBELL
from shm.read.content import (
    head_of,
    holds_test,
    is_gzipped,
    is_text,
    refuse_unless_readable,
    refuse_unreadable_suffix,
    text_of,
)
from shm.read.describe import describe
from shm.read.header import CHANNEL_KEYS, Header, known_values
from shm.read.mini_seed_file import FORMAT as MINI_SEED
from shm.read.modal_sets import foreign_modes
from shm.read.sidecar import sidecar_document, sidecar_path
from shm.read.table import Column, Description, Table
from shm.read.universal_file import FORMAT as UFF
from shm.read.wave_file import FORMAT as WAVE
from shm.values import NAN, FrequencyResponse, ModalTest, Recording


def open_text(text: str, path: Path, preamble: Sequence[str] = ()) -> tuple[Table, ...]:
    """Return what a text holds, as any logger's where it is none of ours; raises BadInput.

    `preamble` are lines that are said elsewhere, as on other sheets.
    """
    if labview_file.recognises(text):
        return labview_file.tables_in(text, path, lambda: logger_text.table_in(text, path))
    response = comma_separated.response_in(text, path)
    if response is not None:
        return (response,)
    logged = None if logger_text.is_shm_csv(text) else logger_text.table_in(text, path, preamble)
    return (logged or comma_separated.record_in(text, path),)


# The most particular first: any text may be comma-separated.
FORMATS: tuple[Format, ...] = (
    format_of_arrays(
        "HDF5", (".h5", ".hdf5"), hdf5_file.recognises, hdf5_file.opened, "", hdf5_file.write
    ),
    format_of_arrays("MATLAB", (".mat",), matlab_file.recognises, matlab_file.opened),
    format_of_arrays("TDMS", (".tdms",), tdms_file.recognises, tdms_file.opened, "nptdms"),
    format_of_arrays(
        "NumPy", (".npz", ".npy"), numpy_file.recognises, numpy_file.opened, "", numpy_file.write
    ),
    Format(
        "Excel",
        (".xlsx", ".xlsm"),
        excel_file.recognises,
        at_once(lambda path: open_text(*_sheets(path))),
        library="python_calamine",
    ),
    WAVE,
    MINI_SEED,
    CAMPBELL,
    sep005.FORMAT,
    UFF,
    Format(
        "CSV",
        (".csv", ".txt", ".tsv", ".asc", ".dat", ".lvm", ".prn", ".xls"),
        is_text,
        at_once(lambda path: open_text(text_of(path), path)),
        comma_separated.write,
        may_be_gzipped=True,
    ),
)


def _sheets(path: Path) -> tuple[str, Path, tuple[str, ...]]:
    text, preamble = excel_file.text_of_workbook(path)
    return text, path, preamble


def read(path: Path, units: Mapping[str, str] | None = None) -> Recording | FrequencyResponse:
    """Return the content of a file; raises BadInput naming file, line, channel and remedy.

    `units` by the names of channels override what file and sidecar say.
    """
    with format_of(path).open_tables(path) as tables:
        found = [_assembled(table, units) for table in tables]
    if len(found) > 1:
        raise BadInput(
            f"holds {len(found)} records, as of the hits of one test, where one is read.",
            file=path,
            remedy="Ingest it as a whole, or read it with `shm.read.read_test`.",
        )
    return found[0]


def _records(path: Path) -> tuple[Recording | FrequencyResponse, ...]:
    with format_of(path).open_tables(path) as tables:
        return tuple(map(_assembled, tables))


def _assembled(
    table: Table, units: Mapping[str, str] | None = None
) -> Recording | FrequencyResponse:
    if table.refusal is not None:
        raise table.refusal
    return assemble(describe(table, units=units))


def peek(path: Path) -> Peek:
    """Return what the headers of a file say, without its data: of the first of several records.

    Faults of the description are listed in `problems`; a file of which nothing can be made out
    raises BadInput.
    """
    return _looks(path)[0]


def _looks(path: Path) -> tuple[Peek, ...]:
    found = format_of(path)
    with found.open_tables(path) as tables:
        return tuple(look(table, found.name) for table in tables)


def look(table: Table, file_format: str) -> Peek:
    """Return what is said of a table, without its values; faults become problems."""
    problems = list(table.problems)
    attempt = collecting(problems)
    if table.refusal is not None:
        return Peek(table.source, file_format, (), 0, problems=(*problems, str(table.refusal)))
    found = attempt(lambda: describe(table), None)
    if found is None:
        found = describe(table, with_sidecars=False)
    return replace(look_at(found, file_format, attempt), problems=tuple(problems))


def write(recording: Recording | FrequencyResponse, path: Path) -> None:
    """Write a file in the format of its suffix; an interrupted write leaves the old file.

    A format that cannot hold everything gets a sidecar, written first. Raises UsageError for a
    suffix without a format that is written, and for data that the format cannot hold.
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
    """Return the format of the suffix, after a look at the content; raises BadInput."""
    head = head_of(path)
    if holds_test(path):
        raise BadInput(
            "holds the files of a test, where one file is read.",
            file=path,
            remedy="Unpack it, or ingest the archive as a whole.",
        )
    recognised = next((known for known in FORMATS if known.recognises(head)), None)
    claimed = _format_of_suffix(_unpacked_name(path), recognised)
    if claimed is None or (is_gzipped(path) and not claimed.may_be_gzipped):
        raise refuse_unreadable_suffix(path, _suffixes(), recognised)
    if claimed is sep005.FORMAT and sep005.is_json(head):
        return claimed  # its reader says what else the file is
    refuse_unless_readable(path, head, claimed, recognised)
    return claimed


def _unpacked_name(path: Path) -> Path:
    return path.with_suffix("") if is_gzipped(path) else path


def _format_of_suffix(path: Path, recognised: Format | None = None) -> Format | None:
    """Return the format that a suffix claims, or the one recognised where it shares that suffix."""
    suffix = path.suffix.lower()
    if recognised is not None and suffix in recognised.shared_suffixes:
        return recognised
    return next((known for known in FORMATS if suffix in known.suffixes), None)


def _suffixes() -> list[str]:
    return [suffix for known in FORMATS for suffix in known.suffixes]


def libraries_for(path: Path) -> tuple[str, ...]:
    """Return the libraries that reading a file loads, by its suffix; an archive may need all."""
    suffix = _unpacked_name(path).suffix.lower()
    formats = (
        FORMATS
        if holds_test(path)
        else [f for f in FORMATS if suffix in f.suffixes + f.shared_suffixes]
    )
    return tuple(each.library for each in formats if each.library)


T = TypeVar("T")
Found = TypeVar("Found", bound=Recording | FrequencyResponse | Peek | ModalTest)
OfFile = TypeVar("OfFile", bound=Recording | FrequencyResponse | Peek)


def read_test(path: Path) -> tuple[Recording | FrequencyResponse, ...]:
    """Return the records of one test: of all files of a .zip, in the order of names, or of one."""
    if not holds_test(path):
        return _records(path)
    head_of(path)
    return _of_members(path, _records, entries_of_test(path).of_test)


def peek_test(path: Path) -> tuple[Peek, ...]:
    """Return what the headers of each record of a test say.

    Members that cannot be read have that as problem.
    """
    if not holds_test(path):
        return _looks(path)
    head_of(path)
    problems: list[str] = []
    stated = read_of_test(entries_of_test(path), collecting(problems))
    looks = _of_members(path, _looks, stated, _unreadable)
    return tuple(replace(each, problems=(*each.problems, *problems)) for each in looks)


def _unreadable(name: str, refusal: BadInput) -> tuple[Peek, ...]:
    return (Peek(name, "not readable", (), 0, problems=(str(refusal),)),)


def _of_members(
    path: Path,
    verb: Callable[[Path], Sequence[OfFile]],
    stated: Mapping[str, Any],
    otherwise: Callable[[str, BadInput], Sequence[OfFile]] | None = None,
) -> tuple[OfFile, ...]:
    """Return what a verb finds in each file of an archive, and `stated` of all of it.

    `otherwise` stands for a file that is refused.
    """

    def of_member(file: Path, name: str) -> Sequence[OfFile]:
        try:
            return [replace(each, source=name) for each in _named(verb, file, name)]
        except BadInput as refusal:
            if otherwise is None:
                raise
            return otherwise(name, refusal)

    found = each_member(path, of_member)
    return tuple(_with_stated(each, stated) for of_file in found for each in of_file)


def _named(verb: Callable[[Path], T], file: Path, name: str) -> T:
    """Return the result of `verb`; refusals name the member, not its temporary file."""
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
    """Return the tests of a `*.modes.json` file; raises BadInput with file, test, mode and remedy.

    Hanger, time, temperature and the known mass of a sidecar are those of its tests.
    """
    tests = modes_document.load_modes(path)
    _refuse_channels(path)
    stated = entries_of_test(path)
    _refuse_what_samples_have(stated, tests, path)
    return tuple(_with_stated(test, stated.of_test) for test in tests)


def _with_stated(found: Found, stated: Mapping[str, Any]) -> Found:
    """Return a test with what a sidecar says of all of it; None and NaN change nothing."""
    known = known_values(stated)
    return replace(found, **{key: value for key, value in known.items() if hasattr(found, key)})


def _refuse_channels(path: Path) -> None:
    for key in sidecar_document(path).keys() & {"channel", *CHANNEL_KEYS}:
        raise BadInput(
            f"{key!r} is said of modes, which have no channels.",
            file=sidecar_path(path),
            remedy=f"Say hanger, time and temperature_c here, all else in {path.name}.",
        )


def _refuse_what_samples_have(stated: Header, tests: tuple[ModalTest, ...], path: Path) -> None:
    sidecar = sidecar_path(path)
    if not math.isnan(stated.sampling_rate_hz):
        raise BadInput(
            "sampling_rate_hz is said of modes, whose frequencies are known.",
            file=sidecar,
            remedy=f"Correct the frequencies in {path.name} and send it again.",
        )
    if stated.time is not None and len(tests) > 1:
        raise BadInput(
            f"one time is said of {len(tests)} tests.",
            file=sidecar,
            remedy=f"Give each test its own time in {path.name}.",
        )


_FINGERPRINT_DIGITS = 16  # technical: of 64 bits; a workspace has a handful of loggers


def survey(path: Path) -> Survey:
    """Return all that can be found out about a file; raises BadInput where that is nothing."""
    if not holds_test(path):
        return _survey_file(path)
    head_of(path)
    entries = entries_of_test(path)
    found = _of_members(path, lambda file: [_survey_file(file)], entries.of_test)
    if len({each.layout.fingerprint for each in found}) > 1:
        raise BadInput(
            "is an archive of files of several loggers.",
            file=path,
            remedy="Unpack it and import one of its files of each.",
        )
    first, several = found[0], f"the first of {len(found)} files is shown"
    orders = {each.layout.day_order for each in found} - {None}
    layout = replace(
        first.layout,
        possible_times=(),
        day_order=orders.pop() if len(orders) == 1 else None,
        local_time=first.layout.local_time if len(found) == 1 and entries.time is None else None,
    )
    remarks = (*first.remarks, *([several] if len(found) > 1 else []))
    return replace(first, source=str(path), layout=layout, remarks=remarks)


def _survey_file(path: Path) -> Survey:
    known = format_of(path)
    with known.open_tables(path) as tables:
        return _surveyed(tables, known.name, path)


def _surveyed(tables: Sequence[Table], file_format: str, path: Path) -> Survey:
    table = tables[0]
    seen, plain = look(table, file_format), describe(table, with_sidecars=False)
    problems = list(seen.problems)
    if seen.lines or plain.is_response:
        columns = [
            SurveyedColumn(**vars(channel), meant=channel.quantity, described_unit=channel.unit)
            for channel in seen.channels
        ]
    else:
        columns = collecting(problems)(lambda: _columns(table, seen), [])
    if not columns and seen.left_out:
        problems.append(f"it holds {', '.join(seen.left_out)[:200]}, which is not read.")
    several = f"holds {len(tables)} records of one test; the first is shown"
    length = next((len(c.values) for c in columns if c.values is not None), 0)
    return replace(
        Survey(**vars(seen), columns=tuple(columns), layout=_layout(plain, file_format, columns)),
        source=str(path),
        samples=seen.samples or length,
        remarks=(*table.remarks, *([several] if len(tables) > 1 else [])),
        problems=tuple(problems),
    )


def _may_be_chosen(table: Table) -> list[Column]:
    """Return the columns of numbers that are as long as the channels, or else as most are."""
    measured = [column for column in table.columns if column.role == "channel"]
    may_be = table.choosable
    sizes = [(column.size, column.rate_hz) for column in measured or may_be]
    usual = max(map(str, sizes), key=list(map(str, sizes)).count, default="")
    return [column for column in may_be if str((column.size, column.rate_hz)) == usual]


def layout_of(path: Path) -> Layout:
    """Return the layout of a file alone; raises BadInput where nothing can be made out."""
    return survey(path).layout


def _columns(table: Table, seen: Peek) -> list[SurveyedColumn]:
    """Return the columns of a table of time records, with what is said of those that are used."""
    known = {channel.name: channel for channel in seen.channels}
    return [_column(each, known.get(each.name)) for each in _may_be_chosen(table)]


def _column(column: Column, known: PeekChannel | None) -> SurveyedColumn:
    meant, plane = words.quantity_meant(column.name), words.plane_meant(column.name)
    values = np.asarray(column.load(), float)
    found = known or PeekChannel(column.name, None, plane=plane)
    if known is not None and known.plane is None and known.quantity == "acceleration":
        found = replace(known, plane=plane)
    described_unit = known.unit if known else ""
    return SurveyedColumn(
        **{**vars(found), "unit": column.unit}, values=values, overloads=column.overloads,
        meant=meant, described_unit=described_unit,
    )  # fmt: skip


def _layout(plain: Description, file_format: str, columns: Sequence[SurveyedColumn]) -> Layout:
    """Return the layout by what the file itself says, whatever a sidecar adds."""
    table, attempt = plain.table, collecting([])
    is_response = bool(columns) and columns[0].values is None
    names = tuple(f"{c.name} [{c.unit}]" if c.unit and not is_response else c.name for c in columns)
    stated = names if is_response else table.layout
    digest = hashlib.sha256("\n".join((file_format, *stated)).encode()).hexdigest()
    in_file = table.file_header
    rates = (
        attempt(lambda: in_file.sampling_rate_hz, NAN),
        attempt(lambda: sampling_rate(plain), NAN),
    )
    return Layout(
        digest[:_FINGERPRINT_DIGITS],
        file_format,
        names,
        attempt(lambda: in_file.hanger, None),
        any(rate > 0 for rate in rates),
        table.day_order,
        table.possible_times,
        table.local_time,
    )


def from_sep005(
    channels: Sequence[Mapping[str, Any]] | Mapping[str, Any], *, hanger: int | None = None
) -> Recording:
    """Return the recording that SEP005 channels hold: those in units of force or acceleration.

    Raises BadInput naming the channel where a key is missing or nothing can be read.
    """
    listed = [channels] if isinstance(channels, Mapping) else list(channels)
    table = sep005.table_of(listed, Path(sep005.NAME), hanger)
    found = assemble(describe(table, with_sidecars=False))
    assert isinstance(found, Recording)
    return replace(found, source=sep005.NAME)


VERBS: dict[str, Callable[[Path], Sequence[object]]] = {
    "read_test": read_test,
    "peek_test": peek_test,
    "load_modes": load_modes,
    "survey": lambda path: [survey(path)],
    "layout_of": lambda path: [layout_of(path)],
    "foreign_modes": lambda path: [each for each in [foreign_modes(path)] if each],
    "do_nothing": lambda _: [],
}
"""What the sandbox may be asked to do with a file."""
