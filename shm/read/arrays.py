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

from shm.read.header import CHANNEL_KEYS

# judgement: twice the 16 accelerations of setting max_channels; a wider table is no recording
_MOST_COLUMNS = 32
_MOST_TEXT = 1000  # characters; longer texts say nothing about a channel


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
