"""NumPy files: .npz with named arrays, in the layout of `arrays`; .npy with one table.

Nothing is ever unpickled: arrays of Python objects are refused by their header. The rows of a .npy
are row_1, row_2, ...; its sidecar says what each is.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from shm.errors import BadInput, UsageError
from shm.read.array_reading import format_of_arrays
from shm.read.arrays import Arrays, Variable, layout_of
from shm.read.atomic import replace_file
from shm.read.bundles import FIRST_DAY
from shm.read.content import checked_members
from shm.read.limits import guarded, refuse_large
from shm.values import FrequencyResponse, Recording

_MAGIC = b"\x93NUMPY"
_TABLE = "row"
# numpy.lib.format: 3.0 only adds names of fields in UTF-8, and tables with fields are not read
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def _recognises(head: bytes) -> bool:
    packed = head.startswith(b"PK\x03\x04") and b".npy" in head[30:300]
    return packed or head.startswith(_MAGIC)


@contextmanager
def _opened(path: Path) -> Iterator[Arrays]:
    with guarded(path):
        with path.open("rb") as stream:
            single = stream.read(len(_MAGIC)) == _MAGIC
        members = [] if single else checked_members(path)
    if single:
        with guarded(path):
            found = [_variable(_TABLE, lambda: path.open("rb"), path)]
        yield Arrays(tuple(found), {})
        return
    with zipfile.ZipFile(path) as archive:
        with guarded(path):
            names = [member.filename for member in members if member.filename.endswith(".npy")]
            found = [_variable(name[:-4], _opener(archive, name), path) for name in names]
        yield Arrays(tuple(v for v in found if v.kind in "iufcU"), {}, _others(found))


def _others(found: list[Variable]) -> tuple[str, ...]:
    return tuple(variable.name for variable in found if variable.kind not in "iufcU")


def _opener(archive: zipfile.ZipFile, name: str) -> Callable[[], IO[bytes]]:
    return lambda: archive.open(name)


def _variable(name: str, opened: Callable[[], IO[bytes]], path: Path) -> Variable:
    with opened() as stream:
        shape, _, dtype = _header(stream)
    if dtype.hasobject:
        raise BadInput(
            "holds Python objects, which are never unpickled.",
            file=path,
            channel=name,
            remedy="Save plain arrays of numbers and texts.",
        )
    refuse_large(shape, dtype.itemsize, name, path)
    kind = "U" if dtype.kind == "S" else dtype.kind
    return Variable(name, shape, kind, dtype.itemsize, lambda: _values(opened))


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, Fortran order and type of the array at the beginning of a stream."""
    return _HEADERS[npy.read_magic(stream)](stream)


def _values(opened: Callable[[], IO[bytes]]) -> NDArray[Any]:
    with opened() as stream:
        shape, fortran, dtype = _header(stream)
        content = stream.read(math.prod(shape) * dtype.itemsize + 1)
    values = np.frombuffer(content, dtype=dtype)
    values = values.reshape(shape[::-1]).T if fortran else values.reshape(shape)
    return np.char.decode(values, "latin-1") if dtype.kind == "S" else values


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    if path.suffix.lower() == ".npy":
        raise UsageError("a .npy file holds one array without names.", remedy="Write a .npz file.")
    arrays = {name: np.asarray(value) for name, value in layout_of(described).flat.items()}
    replace_file(path, lambda temporary: _save(temporary, arrays))


def _save(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", FIRST_DAY)
            with archive.open(member, "w") as stream:
                npy.write_array(stream, values, allow_pickle=False)


FORMAT = replace(format_of_arrays("NumPy", (".npz", ".npy"), _recognises, _opened), write=_write)
