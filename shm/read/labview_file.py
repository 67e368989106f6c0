"""LabVIEW measurement files (.lvm) by lvm_read: a record for each heading of channels.

`X_Columns` says whether none, one or each channel has a column of x before it, which is no channel;
`X_Dimension` says of what x is. `Multi_Headings Yes` is LabVIEW's way to write hit after hit. A
channel with 0 samples is empty.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from shm.documents import format_time
from shm.errors import BadInput
from shm.read.header import entries_of
from shm.read.limits import guarded, refuse_large, refuse_long_header, refuse_many_samples
from shm.read.logger_heading import distinct_names, unrounded
from shm.read.stamps import moment
from shm.read.table import Column, Table
from shm.read.time_axis import rate_of
from shm.values import NAN, FloatArray

_FIRST = "LabVIEW Measurement"
_X, _COMMENT = "X_Value", "Comment"
_SEPARATORS = {"Tab": "\t", "Comma": ","}


def recognises(text: str) -> bool:
    """Return whether a text begins as LabVIEW's files do."""
    return text.startswith(_FIRST)


def tables_in(text: str, path: Path, as_plain: Callable[[], Table | None]) -> tuple[Table, ...]:
    """Return a table for each record of a file; raises BadInput where none is found.

    `as_plain` reads it as a plain text, as it was before this reader: the layout is still that of
    the plain text where both say the same, so that the profiles of loggers stay in force.
    """
    import lvm_read  # few files are of this kind

    refuse_long_header(len(text.partition(_X)[0]), path)
    refuse_large((text.count("\n") * (1 + text[:10_000].count("\t")),), 8, "", path)
    with guarded(path, "the LabVIEW file"):
        named = text.partition("Separator\t")[2].split("\n", 1)[0].strip()
        lines = text.splitlines(keepends=True)
        found: dict[Any, Any] = lvm_read.read_lines(lines, _SEPARATORS.get(named, "\t"))
        records = [found[place] for place in range(found["Segments"])]
        records = _joined([record for record in records if len(record.get("data", ()))])
    if not records:
        raise BadInput(
            "no record holds a sample.",
            file=path,
            remedy="Let LabVIEW write the channels behind the heading, or export as TDMS or CSV.",
        )
    names = [f"record_{place}" for place in range(1, len(records) + 1)]
    return tuple(
        _table(record, found, name if len(records) > 1 else "", as_plain, path)
        for record, name in zip(records, names, strict=True)
    )


def _joined(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the records, those as one of which each begins where the one before it ends."""
    found: list[dict[str, Any]] = []
    for record in records:
        before = found[-1] if found else None
        if before is not None and _goes_on(before, record):
            found[-1] = {**before, "data": np.vstack([before["data"], record["data"]])}
        else:
            found.append(record)
    return found


def _goes_on(before: Mapping[str, Any], record: Mapping[str, Any]) -> bool:
    """Return whether a record is the next piece of another: by its x column, else by its start."""
    same_layout = all(
        before.get(key) == record.get(key) for key in ("Channel names", "Y_Unit_Label")
    )
    step, first, second = _number(_first(record, "Delta_X")), before["data"], record["data"]
    if not (same_layout and step > 0 and first.shape[1] == second.shape[1]):
        return False
    if record["Channel names"][0] == _X:
        return bool(abs(second[0, 0] - first[-1, 0] - step) < step / 2)
    starts = [moment(_first(each, "Date"), _first(each, "Time")) for each in (before, record)]
    if starts[0] is None or starts[1] is None:
        return False
    apart = (starts[1] - starts[0]).total_seconds()
    return abs(apart - step * len(first)) < step / 2


def _table(
    record: Mapping[str, Any],
    whole: Mapping[Any, Any],
    name: str,
    as_plain: Callable[[], Table | None],
    path: Path,
) -> Table:
    data: FloatArray = np.asarray(record["data"], float)
    refuse_many_samples(len(data), path)
    with guarded(path, "the LabVIEW file"):
        places = _channels(record, data.shape[1])
        columns, remarks = _columns(record, places, data, path)
    day, clock = _first(record, "Date"), _first(record, "Time")
    time = moment(day, clock) or moment(str(whole.get("Date", "")), str(whole.get("Time", "")))
    step = _number(_first(record, "Delta_X"))
    times = _times(record, data, path)
    of_time = any(each in ("", "Time") for each in record.get("X_Dimension", [""]))
    rate = 1 / step if step > 0 and of_time else NAN
    if times is not None and of_time:
        by_times = rate_of(times.load(), Table(path, ()).uneven(times))
        rate = unrounded(rate, by_times, [("Delta_X", repr(step))], ".")
        columns = (*columns, times)
    entries = entries_of({"time": format_time(time), "sampling_rate_hz": rate}, path)
    layout = _layout([column for column in columns if column is not times], as_plain)
    return Table(path, columns, entries, layout, remarks=remarks, record=name, local_time=time)


def _times(record: Mapping[str, Any], data: FloatArray, path: Path) -> Column | None:
    """Return the first column of x, in s; None where the file has none."""
    if record["Channel names"][0] != _X or not np.isfinite(data[:, 0]).all() or len(data) < 2:
        return None
    return Column(_X, len(data), data[:, 0].copy, "s", "times")


def _channels(record: Mapping[str, Any], width: int) -> list[int]:
    """Return the columns of channels: all but those of x, comments, and what is empty."""
    names = list(record["Channel names"])[:width]
    return [place for place, name in enumerate(names) if name not in (_X, _COMMENT)]


def _columns(
    record: Mapping[str, Any],
    places: Sequence[int],
    data: FloatArray,
    path: Path,
) -> tuple[tuple[Column, ...], tuple[str, ...]]:
    units = _of_channels(record, "Y_Unit_Label", places)
    counts = [_number(each) for each in _of_channels(record, "Samples", places)]
    names = distinct_names([str(record["Channel names"][place]) for place in places])
    columns, remarks = [], []
    for place, name, unit, count in zip(places, names, units, counts, strict=True):
        values = data[:, place]
        if count == 0 or np.isnan(values).all():
            continue
        missing = int(np.isnan(values).sum())
        if missing:
            remarks.append(f"{missing} values of {name} are no numbers; taken as missing.")
        columns.append(Column.of_logger(name, str(unit), values, path))
    return tuple(columns), tuple(remarks)


def _of_channels(record: Mapping[str, Any], key: str, places: Sequence[int]) -> list[Any]:
    """Return a line of the heading for the channels in columns of numbers, "" where it ends."""
    listed, with_x = list(record.get(key, [])), record["Channel names"][0] == _X
    return [listed[p - with_x] if p - with_x < len(listed) else "" for p in places]


def _first(record: Mapping[str, Any], key: str) -> Any:
    return next((each for each in record.get(key, []) if each == each and each != ""), "")


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else NAN


def _layout(columns: Sequence[Column], as_plain: Callable[[], Table | None]) -> tuple[str, ...]:
    with suppress(BadInput):
        plain = as_plain()
        if plain is not None and [c.name for c in plain.choosable] == [c.name for c in columns]:
            return plain.layout
    return ("LabVIEW", *(f"{column.name} [{column.unit}]" for column in columns))
