"""NumPy files: .npz with named arrays, in the layout of `arrays`; .npy with one table.

Nothing is ever unpickled: arrays of Python objects are refused by their header. The rows of a .npy
are row_1, row_2, ...; its sidecar says what each is.
"""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from shm.errors import BadInput, UsageError
from shm.read.arrays import Arrays, Variable
from shm.read.atomic import replace_file
from shm.read.base import names_in
from shm.read.content import FIRST_DAY, checked_members
from shm.read.header import CHANNEL_KEYS, KEYS, condition_entries, known_values
from shm.read.limits import guarded, refuse_large
from shm.read.logger_words import ACCELERANCE, SI
from shm.values import Channel, FrequencyResponse, Recording, ResponsePoint

_MAGIC = b"\x93NUMPY"
_TABLE = "row"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")
_FREQUENCY = "frequency_hz"
_SUFFIXES = tuple(f"_{key}" for key in CHANNEL_KEYS)
# numpy.lib.format: 3.0 only adds names of fields in UTF-8, and tables with fields are not read
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def recognises(head: bytes) -> bool:
    packed = head.startswith(b"PK\x03\x04") and b".npy" in head[30:300]
    return packed or head.startswith(_MAGIC)


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
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


def write(described: Recording | FrequencyResponse, path: Path) -> None:
    if path.suffix.lower() == ".npy":
        raise UsageError("a .npy file holds one array without names.", remedy="Write a .npz file.")
    arrays = {name: np.asarray(value) for name, value in arrays_of(described).items()}
    replace_file(path, lambda temporary: _save(temporary, arrays))


def arrays_of(described: Recording | FrequencyResponse) -> dict[str, Any]:
    """Return the arrays and facts of a recording or of frequency responses by name.

    Raises UsageError for names that some program could not take or take apart.
    """
    for name in names_in(described):
        reserved = name in (*KEYS, _FREQUENCY) or name.endswith(_SUFFIXES)
        if reserved or not _NAME.fullmatch(name):
            raise UsageError(
                f"the channel name {name!r} cannot name an array.",
                remedy="Begin with a letter and use letters, digits and underscores, as in acc_1.",
            )
    found = condition_entries(described)
    if isinstance(described, Recording):
        found["sampling_rate_hz"] = described.sampling_rate_hz
        for channel in described.channels:
            found[channel.name] = channel.values
            facts = {"unit": SI[channel.quantity], "full_scale": channel.full_scale}
            found |= _facts(channel, facts)
        return found
    found |= {_FREQUENCY: described.frequency_hz, f"{_FREQUENCY}_unit": "Hz"}
    for row, point in enumerate(described.points):
        found[point.name] = described.accelerance[row]
        found |= _facts(point, {"unit": ACCELERANCE})
        if described.coherence is not None:
            found[f"{point.name}_coherence"] = described.coherence[row]
    return found


def _facts(point: Channel | ResponsePoint, more: dict[str, Any]) -> dict[str, Any]:
    """Return what is known of a channel or point, as NAME_unit and so on."""
    known = known_values({"plane": point.plane, "x_m": point.x_m, **more})
    return {f"{point.name}_{key}": value for key, value in known.items()}


def _save(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", FIRST_DAY)
            with archive.open(member, "w") as stream:
                npy.write_array(stream, values, allow_pickle=False)
