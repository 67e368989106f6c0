"""Describe the named arrays of HDF5, MATLAB, TDMS and NumPy files before they are loaded.

This is the one layout that readers look for and that NumPy files are written in:

    force, acc_1, ...                     time records, N and m/s^2, float64 (samples,)
    frequency_hz                          of frequency responses, float64 (lines,)
    NAME, NAME_coherence                  accelerance, m/s^2/N, complex128; coherence, float64
    hanger, time, temperature_c, sampling_rate_hz     of the recording, as far as they are known
    unit, plane, x_m, full_scale          of each channel, as far as they are known

HDF5 and TDMS hold the facts of the recording and of a channel as attributes (properties); NumPy and
MATLAB files as further arrays, NAME_unit and so on.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shm.documents import format_time
from shm.errors import UsageError
from shm.read.base import names_in
from shm.read.header import CHANNEL_KEYS, KEYS, known_values, mass_entries
from shm.read.logger_words import ACCELERANCE, SI
from shm.values import (
    Channel,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Recording,
    ResponsePoint,
)

# judgement: twice the 16 accelerations of setting max_channels; a wider table is no recording
_MOST_COLUMNS = 32
_MOST_TEXT = 1000  # characters; longer texts say nothing about a channel
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")
_FREQUENCY = "frequency_hz"
_COHERENCE = "_coherence"


@dataclass(frozen=True, eq=False)
class Variable:
    """One array of a file: its shape and numpy kind (i, u, f, c; U for text), not yet its values.

    `load` gives the values in that shape; `attributes` are plain values by lower-case name.
    """

    name: str
    shape: tuple[int, ...]
    kind: str
    item_bytes: int
    load: Callable[[], NDArray[Any]]
    attributes: Mapping[str, object] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=object))

    @property
    def is_series(self) -> bool:
        """Return whether it can be a channel: numbers in one row."""
        return self.kind in "iufc" and len(self.shape) == 1 and self.size > 1

    @property
    def is_fact(self) -> bool:
        """Return whether it is a single number or a short text."""
        return self.size <= _MOST_TEXT if self.kind == "U" else self.size == 1


@dataclass(frozen=True, eq=False)
class Arrays:
    """All that a file holds: variables, facts about the whole, and names of what is left out."""

    variables: tuple[Variable, ...]
    attributes: Mapping[str, object]
    left_out: tuple[str, ...] = ()


def flatten_tables(arrays: Arrays) -> Arrays:
    """Return arrays with single numbers and texts as attributes, and tables as single rows.

    `acc_1_unit` becomes the attribute `unit` of `acc_1`; other facts become general attributes.
    The rows or columns of a table DATA, whichever are longer, become DATA_1, DATA_2, ...
    """
    facts = {v.name: _fact(v) for v in arrays.variables if v.is_fact}
    series = [part for v in arrays.variables if not v.is_fact for part in _parts(v)]
    facts_of = {v.name: facts_about(v.name, facts) for v in series}
    taken = {f"{name}_{key}" for name, about in facts_of.items() for key in about}
    general = {name: value for name, value in facts.items() if name not in taken}
    variables = (replace(v, attributes={**facts_of[v.name], **v.attributes}) for v in series)
    return Arrays(tuple(variables), {**general, **arrays.attributes}, arrays.left_out)


def facts_about(name: str, facts: Mapping[str, object]) -> dict[str, object]:
    """Return the facts about `name` by channel key: `acc_1_unit` is the unit of acc_1."""
    return {key: facts[f"{name}_{key}"] for key in CHANNEL_KEYS if f"{name}_{key}" in facts}


def plain(value: object) -> object:
    """Return an attribute as text, number or time; None for any other type."""
    if isinstance(value, np.ndarray):
        return plain(value.ravel()[0]) if value.size == 1 else None
    if isinstance(value, np.datetime64):
        return str(value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return value if isinstance(value, (str, bool, int, float, datetime)) else None


def attributes_of(pairs: Iterable[tuple[str, object]]) -> dict[str, object]:
    """Return attributes that have a plain value, by lower-case name."""
    found = {str(key).lower(): plain(value) for key, value in pairs}
    return {key: value for key, value in found.items() if value is not None}


def natural_sort_key(name: str) -> list[tuple[int, int, str]]:
    """Return a sort key that places acc_2 before acc_10."""
    pieces = re.split(r"(\d+)", name.lower())
    return [(1, int(p), "") if p.isdecimal() and p.isascii() else (0, 0, p) for p in pieces]


def unique_names(paths: Sequence[tuple[str, ...]]) -> list[str]:
    """Return the last part of each path where that is unique, else the path with slashes."""
    last = [path[-1] for path in paths]
    return [path[-1] if last.count(path[-1]) == 1 else "/".join(path) for path in paths]


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


@dataclass(frozen=True, eq=False)
class NamedArray:
    """An array to be written, with what is said about it."""

    name: str
    values: FloatArray | ComplexArray
    attributes: Mapping[str, str | float]


@dataclass(frozen=True, eq=False)
class Layout:
    """The arrays of a file to be written, and what is said about the whole."""

    arrays: tuple[NamedArray, ...]
    attributes: Mapping[str, str | float]

    @property
    def flat(self) -> dict[str, FloatArray | ComplexArray | str | float]:
        """All by name: what belongs to a channel becomes NAME_unit and so on."""
        found: dict[str, FloatArray | ComplexArray | str | float] = dict(self.attributes)
        for array in self.arrays:
            found[array.name] = array.values
            found.update({f"{array.name}_{key}": v for key, v in array.attributes.items()})
        return found


def layout_of(described: Recording | FrequencyResponse) -> Layout:
    """Return the arrays of a recording or of frequency responses.

    Raises UsageError for names that some program could not take or take apart.
    """
    for name in names_in(described):
        reserved = name in (*KEYS, _FREQUENCY) or name.endswith(_suffixes())
        if reserved or not _NAME.fullmatch(name):
            raise UsageError(
                f"the channel name {name!r} cannot name an array.",
                remedy="Begin with a letter and use letters, digits and underscores, as in acc_1.",
            )
    known = {
        "hanger": described.hanger,
        "time": format_time(described.time),
        "temperature_c": described.temperature_c,
        **mass_entries(described.added_mass),
    }
    if isinstance(described, FrequencyResponse):
        return Layout(_response(described), known_values(known))
    known["sampling_rate_hz"] = described.sampling_rate_hz
    return Layout(tuple(map(_channel, described.channels)), known_values(known))


def _suffixes() -> tuple[str, ...]:
    return tuple(f"_{key}" for key in CHANNEL_KEYS)


def _channel(channel: Channel) -> NamedArray:
    facts = {"unit": SI[channel.quantity], **_place(channel), "full_scale": channel.full_scale}
    return NamedArray(channel.name, channel.values, known_values(facts))


def _response(response: FrequencyResponse) -> tuple[NamedArray, ...]:
    arrays = [NamedArray(_FREQUENCY, response.frequency_hz, {"unit": "Hz"})]
    for row, point in enumerate(response.points):
        facts = known_values({"unit": ACCELERANCE, **_place(point)})
        arrays.append(NamedArray(point.name, response.accelerance[row], facts))
        if response.coherence is not None:
            arrays.append(NamedArray(f"{point.name}{_COHERENCE}", response.coherence[row], {}))
    return tuple(arrays)


def _place(point: Channel | ResponsePoint) -> dict[str, str | float | None]:
    return {"plane": point.plane, "x_m": point.x_m}
