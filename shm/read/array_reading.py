"""Give each named array of a file its role: a channel, a frequency response, times, or none."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shm.errors import BadInput
from shm.read.arrays import Arrays, Variable, plain
from shm.read.base import Format
from shm.read.header import CHANNEL_KEYS, KEYS, Entry, quantity_named
from shm.read.limits import guarded, refuse_large
from shm.read.logger_words import UNIT_MISSING, is_accelerance, unit_of
from shm.read.stamps import moment
from shm.read.table import Column, Role, Table
from shm.values import ComplexArray, FloatArray, FrequencyResponse, Recording

# judgement: twice the 16 accelerations of setting max_channels; a wider table is no recording
_MOST_COLUMNS = 32
_TIMES = {"t", "time", "times", "timedomain", "timevector", "timeaxis", "times_s"}
_FREQUENCIES = {"f", "freq", "frequency", "frequencies", "frequencyhz", "freqdomain", "freqhz"}
_SECONDS = {"s", "sec", "second", "seconds"}
_RESPONSES = ("frf", "accelerance")
_RATES = {
    "samplingratehz", "samplingrate", "samplerate", "samplefrequency", "samplingfrequency",
    "samplingfreq", "samplefreq", "fs", "fshz", "timesamplerate",
}  # fmt: skip
_STEPS = {"dt", "dts", "timestep", "samplinginterval", "sampleinterval", "wfincrement"}
_MOMENTS = {"time", "starttime", "wfstarttime", "timeutc"}
_DAYS = {"date", "datetime", "start"}
_KEYS = {
    **{key.replace("_", ""): key for key in KEYS if key != "time"},
    **dict.fromkeys(_RATES, "sampling_rate_hz"),
}  # fmt: skip
_UNITS = ("unit", "units", "unit_string", "unitstring", "y_unit", "engineering_units")


def format_of_arrays(
    name: str,
    suffixes: tuple[str, ...],
    recognises: Callable[[bytes], bool],
    opened: Callable[[Path], AbstractContextManager[Arrays]],
    library: str = "",
    write: Callable[[Recording | FrequencyResponse, Path], None] | None = None,
) -> Format:
    """Return the format whose files are opened so; a look loads no channel."""

    @contextmanager
    def open_tables(path: Path) -> Iterator[tuple[Table, ...]]:
        with opened(path) as arrays:
            with guarded(path):
                whole = flatten_tables(arrays)
            yield (_table(whole, path, name),)

    return Format(name, suffixes, recognises, open_tables, write, library=library)


def _table(arrays: Arrays, path: Path, name: str) -> Table:
    """Return the arrays of a file: channels first, then all that may be one."""
    columns = [_column(variable, path) for variable in arrays.variables]
    if not any(column.is_complex for column in columns):
        columns = [_as_record(column) for column in columns]
    measured = [column for column in columns if column.role == "channel"]
    others = [column for column in columns if column.role != "channel"]
    may_be = [column for column in others if column.may_be_chosen and column.role == "other"]
    lengths = [column.size for column in measured or may_be]
    usual = max(set(lengths), key=lengths.count, default=0)
    named = (f"{c.name} [{c.unit}]" for c in (*measured, *may_be) if c.size == usual)
    return Table(
        path,
        (*measured, *others),
        _entries(facts(arrays.attributes), path),
        (name, *named),
        left_out=arrays.left_out,
    )


def _as_record(column: Column) -> Column:
    """Return a column of a file without responses, where F may be a force."""
    is_f = column.role == "frequencies" and not column.unit and _bare(column.name) == "f"
    return replace(column, role="other") if is_f else column


def _column(variable: Variable, path: Path) -> Column:
    return Column(
        variable.name,
        variable.size,
        partial(_loaded, variable, path),
        unit_in(variable),
        role(variable),
        _channel_entries(variable, path),
        _entries(facts(variable.attributes), path),
        is_complex=variable.kind == "c",
        may_be_chosen=variable.is_series and variable.kind != "c",
    )


def _loaded(variable: Variable, path: Path) -> FloatArray | ComplexArray:
    refuse_large(variable.shape, max(8, variable.item_bytes), variable.name, path)
    with guarded(path, f"the array {variable.name!r}"):
        values = np.asarray(variable.load())
    if values.shape != variable.shape:
        raise BadInput(
            f"holds {values.size} values where its header says {variable.size}.",
            file=path,
            channel=variable.name,
            remedy="The file is damaged: export or send it again.",
        )
    return values


def _entries(found: Mapping[str, object], path: Path) -> dict[str, Entry]:
    return {key: Entry(value, path) for key, value in found.items() if key in KEYS}


def _channel_entries(variable: Variable, path: Path) -> dict[str, Entry]:
    stated = {key: variable.attributes[key] for key in CHANNEL_KEYS if key in variable.attributes}
    # A name such as force promises newtons in our own CSV alone.
    unit = unit_in(variable) or ("" if variable.kind == "c" else UNIT_MISSING)
    return {k: Entry(v, path) for k, v in {**stated, "unit": unit}.items()}


def role(variable: Variable) -> Role:
    """Return the role of a variable by the file alone: its unit goes before its name.

    What nobody names and does not look like a channel is left for a person to describe.
    """
    if not variable.is_series:
        return "other"
    unit, name, bare = unit_in(variable), variable.name, _bare(variable.name)
    plain = unit.strip(" []()").lower()
    if variable.kind == "c":
        named = name.lower().startswith(_RESPONSES) or quantity_named(name) == "acceleration"
        return "response" if named or is_accelerance(unit) else "other"
    if plain in _SECONDS:
        return "times"
    if plain == "hz":
        return "frequencies"
    if unit_of(unit) is not None:
        return "channel"
    if name.lower().endswith("_coherence"):
        return "coherence"
    if quantity_named(name) is not None:
        return "channel"
    return "times" if bare in _TIMES else "frequencies" if bare in _FREQUENCIES else "other"


def unit_in(variable: Variable) -> str:
    """Return the unit that a variable's attributes give, in any of the spellings of loggers."""
    found = (str(variable.attributes.get(key, "")).strip() for key in _UNITS)
    return next(filter(None, found), "")


def facts(attributes: Mapping[str, object]) -> dict[str, object]:
    """Return hanger, time, temperature, known mass, rate in any of the spellings of loggers."""
    found: dict[str, object] = {}
    for name, value in attributes.items():
        key = _bare(name)
        if key in _KEYS:
            found[_KEYS[key]] = value
        elif key in _MOMENTS and not isinstance(value, int | float):
            found["time"] = value
        elif key in _DAYS and (day := moment("", str(value))) is not None:
            found.setdefault("time", day.isoformat())
        elif key in _STEPS and isinstance(value, int | float) and value > 0:
            found.setdefault("sampling_rate_hz", 1 / value)
    return found


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def flatten_tables(arrays: Arrays) -> Arrays:
    """Return arrays with single numbers and texts as attributes, and tables as single rows.

    `acc_1_unit` becomes the attribute `unit` of `acc_1`; other facts become general attributes.
    The rows or columns of a table DATA, whichever are longer, become DATA_1, DATA_2, ...
    """
    stated = {v.name: _fact(v) for v in arrays.variables if v.is_fact}
    series = [part for v in arrays.variables if not v.is_fact for part in _parts(v)]
    facts_of = {v.name: facts_about(v.name, stated) for v in series}
    taken = {f"{name}_{key}" for name, about in facts_of.items() for key in about}
    general = {name: value for name, value in stated.items() if name not in taken}
    variables = (replace(v, attributes={**facts_of[v.name], **v.attributes}) for v in series)
    return Arrays(tuple(variables), {**general, **arrays.attributes}, arrays.left_out)


def facts_about(name: str, stated: Mapping[str, object]) -> dict[str, object]:
    """Return the facts about `name` by channel key: `acc_1_unit` is the unit of acc_1."""
    return {key: stated[f"{name}_{key}"] for key in CHANNEL_KEYS if f"{name}_{key}" in stated}


def _fact(variable: Variable) -> object:
    values = variable.load()
    if variable.kind == "U":
        return "".join(str(text) for text in np.ravel(values)).strip()
    return plain(values)


def _parts(variable: Variable) -> list[Variable]:
    """Return the variable itself in one row, or the rows of a table."""
    lengths = [length for length in variable.shape if length != 1]
    if variable.kind not in "iufc" or len(lengths) < 2:
        shape = tuple(lengths) or (1,)
        return [replace(variable, shape=shape, load=lambda: variable.load().reshape(shape))]
    if len(variable.shape) != 2 or min(lengths) > _MOST_COLUMNS:
        return [variable]
    loaded = cache(variable.load)
    lies = variable.shape[0] <= variable.shape[1]
    return [
        replace(
            variable,
            name=f"{variable.name}_{row + 1}",
            shape=(max(lengths),),
            load=_row(loaded, row, lies),
        )
        for row in range(min(lengths))
    ]


def _row(load: Callable[[], NDArray[Any]], row: int, lies: bool) -> Callable[[], NDArray[Any]]:
    return lambda: load()[row] if lies else load()[:, row]
