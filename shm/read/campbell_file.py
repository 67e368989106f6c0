"""Binary tables of Campbell loggers, TOB1 and TOB3, by csiio; their texts (TOA5) are read as text.

The file's own times give rate and start; array elements keep their numbers, `Acc_Z(1)`.
"""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from shm.read.base import Format, at_once
from shm.read.extras import import_extra
from shm.read.header import Entry
from shm.read.limits import guarded, limits, refuse_large, refuse_many_samples, too_large
from shm.read.logger_heading import distinct_names
from shm.read.logger_words import hanger_numbered, name_and_unit
from shm.read.table import Column, Table
from shm.values import FloatArray

_NAME = "Campbell"
_MOST_COLUMNS = 200  # judgement: far more than the 16 accelerations that are read
_NUMBERS = ("record", "record (rn)")


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a binary table."""
    return head.startswith((b'"TOB1"', b'"TOB3"'))


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return the columns of a table; raises BadInput where it is damaged."""
    if path.stat().st_size > limits().bytes_at_once:
        raise too_large(path)
    library = import_extra("csiio", path)
    with guarded(path, "the table"), redirect_stdout(io.StringIO()):  # it prints what is damaged
        frame = library.read_csi_files(str(path), quiet=True, sortindex=False)
        frame = frame[0] if isinstance(frame, tuple) else frame
        seconds = (frame.index - frame.index[0]).total_seconds().to_numpy(float)
        start = frame.index[0].isoformat()
        named = [str(name) for name in frame.columns]
    refuse_many_samples(len(seconds), path)
    refuse_large((len(seconds), min(len(named), _MOST_COLUMNS)), 8, "", path)
    places = [place for place, name in enumerate(named) if name.lower() not in _NUMBERS]
    split = [name_and_unit(named[place]) for place in places[:_MOST_COLUMNS]]
    names = distinct_names([name for name, _ in split])
    columns = [
        Column.of_logger(name, unit, _values(frame.iloc[:, place]), path)
        for name, (_, unit), place in zip(names, split, places, strict=False)
    ]
    with path.open("rb") as stream:
        station = stream.readline(500).decode("latin-1").partition(",")[2].partition(",")[0]
    entries = {"time": Entry(start, path)}
    if (hanger := hanger_numbered(station)) is not None:
        entries["hanger"] = Entry(hanger, path)
    times = Column("TIMESTAMP", len(seconds), seconds.copy, "s", "times")
    layout = (_NAME, *(f"{name} [{unit}]" for name, (_, unit) in zip(names, split, strict=True)))
    return (Table(path, (times, *columns), entries, layout),)


def _values(series: Any) -> FloatArray:
    """Return numbers, NaN where a cell holds none."""
    kind = series.dtype.kind
    if kind in "iufb":
        return np.asarray(series.to_numpy(), float)
    return np.full(len(series), np.nan)


FORMAT = Format(
    _NAME,
    (".tob3", ".tob1"),
    recognises,
    at_once(open_tables),
    library="csiio",
    shared_suffixes=(".dat",),
)
