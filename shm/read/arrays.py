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
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
