"""MATLAB .mat files: version 5 (save -v7) by scipy, version 7.3 by h5py; written as version 5.

Variables are those of `array_layout`: force, acc_1, sampling_rate_hz, acc_1_unit, acc_1_x_m, ...
Objects, functions, cells and, in version 5, structs are left out unread.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shm.read.array_layout import layout_of
from shm.read.array_reading import peeker, reader
from shm.read.arrays import Arrays, Variable
from shm.read.atomic import replace_file
from shm.read.base import Format
from shm.read.hdf5_tree import opened_nodes, variables
from shm.read.matlab_version_5 import arrays_in, write
from shm.values import FrequencyResponse, Recording

_VERSION_5, _VERSION_7_3 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_NUMBERS = {
    "double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
}  # fmt: skip


def _recognises(head: bytes) -> bool:
    return head.startswith((_VERSION_5, _VERSION_7_3))


@contextmanager
def _opened(path: Path) -> Iterator[Arrays]:
    with path.open("rb") as stream:
        version_7_3 = stream.read(len(_VERSION_7_3)) == _VERSION_7_3
    if not version_7_3:
        yield arrays_in(path)
        return
    with opened_nodes(path) as nodes:
        named = zip(variables(nodes), (n for n in nodes if n.dataset is not None), strict=True)
        seen = [(v, n) for v, n in named if not n.path[0].startswith("#")]
        found = [(_interpreted(v), n.attributes.get("matlab_class")) for v, n in seen]
        readable = tuple(v for v, kind in found if kind in (*_NUMBERS, "char"))
        yield Arrays(readable, {}, tuple(v.name for v, _ in found if v not in readable))


def _interpreted(variable: Variable) -> Variable:
    """MATLAB keeps texts as numbers of their characters."""
    if variable.attributes.get("matlab_class") != "char" or variable.kind not in "iu":
        return variable
    return replace(variable, kind="U", load=lambda: _text(variable.load()))


def _text(codes: NDArray[Any]) -> NDArray[Any]:
    return np.array([chr(int(code)) for code in codes.ravel()])


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    arrays = layout_of(described).flat
    replace_file(path, lambda temporary: write(arrays, temporary))


_NAME = "MATLAB"
FORMAT = Format(
    name=_NAME,
    suffixes=(".mat",),
    recognises=_recognises,
    peek=peeker(_opened, _NAME),
    read=reader(_opened),
    write=_write,
    holds_gaps=True,
    holds_frequency_responses=True,
    needs_sidecar=False,
)
