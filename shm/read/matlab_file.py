"""MATLAB .mat files: version 5 (save -v7) by scipy, version 7.3 by h5py.

Variables are those of `arrays`: force, acc_1, sampling_rate_hz, acc_1_unit, acc_1_x_m, ...
A struct of one element counts as its fields. Objects, functions and cells are left out unread.

The door to scipy.io: the variables of a MATLAB file of version 5 (save -v6, -v7).

The elements of a MATLAB file of version 5, measured before scipy.io takes them.

An element is a tag of type and length. scipy.io looks types up unchecked, so that a damaged one
ends the process: 19 of 800 files with 1 to 3 bytes changed in a variable did (scipy 1.17.1), and
`shm.read` reads in the caller's process. A compressed element may unpack to any size, whatever its
variable's shape says. So parts are checked, and what comes out is counted (MAT-File Format,
MathWorks, chapter 1).
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from shm.errors import BadInput
from shm.read.array_reading import format_of_arrays
from shm.read.arrays import Arrays, Variable, unique_names
from shm.read.content import bytes_of
from shm.read.hdf5_file import opened_nodes, variables
from shm.read.limits import guarded, limits, refuse_large

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
    """Return a variable with MATLAB's numbered characters as text."""
    if variable.attributes.get("matlab_class") != "char" or variable.kind not in "iu":
        return variable
    return replace(variable, kind="U", load=lambda: _text(variable.load()))


def _text(codes: NDArray[Any]) -> NDArray[Any]:
    return np.array([chr(int(code)) for code in codes.ravel()])


FORMAT = format_of_arrays("MATLAB", (".mat",), _recognises, _opened, "scipy.io")


_scipy: Any = scipy  # the stubs of its `io` know no streams
_MOST_VARIABLES = 1000
_OF = "\0"  # between a struct and its field, until names are told apart
_NAME_FIELDS = ("channel_names", "names", "channels", "labels")
_UNIT_FIELDS = ("unit", "units")
_MAX_FIELDS = 20  # judgement: a struct among more is settings of a program, no recording
_KINDS = {
    "double": ("f", 8), "single": ("f", 4), "char": ("U", 4), "int8": ("i", 1), "uint8": ("u", 1),
    "int16": ("i", 2), "uint16": ("u", 2), "int32": ("i", 4), "uint32": ("u", 4),
    "int64": ("i", 8), "uint64": ("u", 8),
}  # fmt: skip


def arrays_in(path: Path) -> Arrays:
    """Return the variables that are numbers or texts; raises BadInput beyond the limits."""
    content = bytes_of(path)
    with guarded(path):
        elements = tuple(elements_of(content))
        complexities = [element.is_complex for element in elements]
        listed = _scipy.io.whosmat(io.BytesIO(content))
        if len(listed) != len(elements) or len(listed) > _MOST_VARIABLES:
            raise ValueError("there are not as many variables as elements")
    _refuse_doubles([name for name, _, _ in listed], path)
    found: list[Variable] = []
    left_out: list[str] = []
    for (name, shape, kind), element, is_complex in zip(
        listed, elements, complexities, strict=True
    ):
        if kind in _KINDS:
            found.append(_variable(name, shape, kind, is_complex, element, content, path))
        elif kind == "struct" and math.prod(shape) == 1 and len(listed) < _MAX_FIELDS:
            fields = _fields(name, element, content, path)
            found += fields
            left_out += [] if fields else [f"{name} ({kind})"]
        else:
            left_out.append(f"{name} ({kind})")
    names = unique_names([tuple(variable.name.split(_OF)) for variable in found])
    apart = [replace(v, name=name) for v, name in zip(found, names, strict=True)]
    return Arrays(tuple(apart), {}, tuple(left_out))


def _fields(name: str, element: Element, content: bytes, path: Path) -> list[Variable]:
    """Return the fields of a struct that hold numbers or a text; none where no record is in it.

    A field `unit` of as many texts as there are records gives the unit of each, in their order; one
    of names those of a table's columns.
    """
    with guarded(path, f"the struct {name!r}"):
        element.refuse_damaged_struct()
        found = _scipy.io.loadmat(io.BytesIO(content), variable_names=[name], simplify_cells=True)[
            name
        ]
        fields = {str(key): np.asarray(value) for key, value in found.items()}
    rows = {
        name: row
        for key, value in fields.items()
        if value.dtype.kind in "iufc"
        for name, row in _rows(key, value, fields)
    }
    if not rows:
        return []
    units = _listed(fields, _UNIT_FIELDS, len(rows))
    by_name = dict(zip(rows, units, strict=True)) if units else {}
    facts = {k: v for k, v in fields.items() if v.dtype.kind in "iufU" and v.size == 1}
    return [
        Variable(
            f"{name}{_OF}{key}",
            value.shape,
            value.dtype.kind,
            value.dtype.itemsize,
            partial(np.asarray, value),
            {"unit": by_name[key]} if key in by_name else {},
        )
        for key, value in {**facts, **rows}.items()
    ]


def _rows(
    key: str, value: NDArray[Any], fields: Mapping[str, NDArray[Any]]
) -> list[tuple[str, NDArray[Any]]]:
    """Return the records in a field: a row, or the columns of a table that another field names."""
    if value.ndim == 1 and value.size > 1:
        return [(key, value)]
    if value.ndim != 2 or min(value.shape) > _MAX_FIELDS or max(value.shape) < 2:
        return []
    columns = value.T if value.shape[0] >= value.shape[1] else value
    names = _listed(fields, _NAME_FIELDS, len(columns))
    names = names or tuple(f"{key}_{place}" for place in range(1, len(columns) + 1))
    return list(zip(names, columns, strict=True))


def _listed(fields: Mapping[str, NDArray[Any]], keys: Sequence[str], count: int) -> tuple[str, ...]:
    """Return as many texts as `count` of the first such field; empty where there is none."""
    for key in keys:
        texts = fields.get(key, np.zeros(0)).ravel()
        if texts.size == count and all(isinstance(text, str) for text in texts):
            return tuple(str(text) for text in texts)
    return ()


def _variable(
    name: str,
    shape: tuple[int, ...],
    kind: str,
    is_complex: bool,
    element: Element,
    content: bytes,
    path: Path,
) -> Variable:
    letter, item_bytes = _KINDS[kind]
    refuse_large(shape, 2 * item_bytes if is_complex else item_bytes, name, path)
    is_text = letter == "U"

    def load() -> NDArray[Any]:
        element.refuse_damaged(shape, is_text)
        found = _scipy.io.loadmat(io.BytesIO(content), variable_names=[name])
        return np.asarray(found[name])

    letter = "c" if is_complex and not is_text else letter
    # A text comes as one string a row.
    return Variable(name, shape[:1] if is_text else shape, letter, item_bytes, load)


def _refuse_doubles(names: Sequence[str], path: Path) -> None:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise BadInput(
            "stands twice in the file.",
            file=path,
            channel=twice,
            remedy="Save each variable once.",
        )


# MAT-File Format, MathWorks, chapter 1
_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_INT8, _INT32, _UINT32 = 1, 5, 6
_NUMBER_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
_TEXTS = (1, 2, 4, 16, 17, 18)
_COMPLEX_FLAG = 0x800
_CELL, _STRUCT, _CHAR, _SPARSE, _LAST_NUMBER = 1, 2, 4, 5, 15  # classes of arrays
_DEEPEST = 3
_CHUNK = 1 << 20  # technical: unpacked at once


@dataclass(frozen=True)
class Element:
    """One variable of a file, still packed."""

    byte_order: str
    kind: int
    packed: bytes

    @property
    def is_complex(self) -> bool:
        """Return whether its values are complex; ValueError where the head is damaged."""
        (kind, flags), dimensions, name = self._head(next(self.pieces()))
        if (kind, len(flags), dimensions[0], name[0]) != (_UINT32, 8, _INT32, _INT8):
            raise ValueError("the head of a variable is damaged")
        return bool(self._number(flags, 0) & _COMPLEX_FLAG)

    def pieces(self) -> Iterator[bytes]:
        """Yield a matrix with its tag, unpacked piece by piece, until it outgrows the limit."""
        if self.kind != _COMPRESSED:
            yield struct.pack(f"{self.byte_order}II", self.kind, len(self.packed)) + self.packed
            return
        stream, size, packed = zlib.decompressobj(), 0, self.packed
        while packed and size <= limits().bytes_at_once:
            piece = stream.decompress(packed, _CHUNK)
            packed = stream.unconsumed_tail
            size += len(piece)
            yield piece

    def refuse_damaged(self, shape: tuple[int, ...], is_text: bool) -> None:
        """Raise ValueError where the values do not match the shape, or are far too many."""
        content = b"".join(self.pieces())
        if len(content) > limits().bytes_at_once:
            raise ValueError("a variable unpacks to more than is read at once")
        values = list(self._parts(content))[3:]
        if len(values) != 1 + self.is_complex:
            raise ValueError("a variable has too many or too few parts")
        for kind, part in values:
            if is_text and kind in _TEXTS:
                continue
            if is_text or len(part) != math.prod(shape) * _NUMBER_BYTES[kind]:
                raise ValueError("a variable's values are not as many as its shape says")

    def refuse_damaged_struct(self) -> None:
        """Raise ValueError where a part of a struct is not what its tag says, or far too large."""
        content = b"".join(self.pieces())
        if len(content) > limits().bytes_at_once:
            raise ValueError("a variable unpacks to more than is read at once")
        self._refuse_damaged_part(content, 0)

    def _refuse_damaged_part(self, content: bytes, depth: int) -> None:
        parts = list(self._parts(content))
        (_, flags), (_, sizes), _, *values = parts
        kind, dims = (
            self._number(flags, 0) & 0xFF,
            [self._number(sizes, place) for place in range(0, len(sizes), 4)],
        )
        if kind in (_STRUCT, _CELL):
            inner = values[2:] if kind == _STRUCT else values
            counted = kind == _STRUCT or len(inner) == math.prod(dims)
            if depth > _DEEPEST or not counted or any(each[0] != _MATRIX for each in inner):
                raise ValueError("a struct is damaged, or nested too deeply")
            for _, part in inner:
                if part:
                    head = struct.pack(f"{self.byte_order}II", _MATRIX, len(part))
                    self._refuse_damaged_part(head + part, depth + 1)
            return
        is_text, is_complex = kind == _CHAR, bool(self._number(flags, 0) & _COMPLEX_FLAG)
        if not _CHAR <= kind <= _LAST_NUMBER or kind == _SPARSE or len(values) != 1 + is_complex:
            raise ValueError("a field of a struct is of a kind that is not read")
        for found, part in values:
            fits = found in _TEXTS if is_text else found in _NUMBER_BYTES
            if not fits or (not is_text and len(part) != math.prod(dims) * _NUMBER_BYTES[found]):
                raise ValueError("a field's values are not as many as its shape says")

    def _head(self, piece: bytes) -> list[tuple[int, bytes]]:
        """Return flags, dimensions and name of a matrix, each with its type."""
        parts = self._parts(piece)
        return [next(parts, (0, b"")) for _ in range(3)]

    def _parts(self, content: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield type and content of each part of a matrix."""
        if self._number(content, 0) != _MATRIX or len(content) < 8:
            raise ValueError("an element is no matrix")
        place, end = 8, min(len(content), 8 + self._number(content, 4))
        while place + 8 <= end:
            kind, length, begin = self._number(content, place), 0, place + 4
            if kind >> 16:
                kind, length, following = kind & 0xFFFF, kind >> 16, place + 8
            else:
                length, begin = self._number(content, place + 4), place + 8
                following = begin + -(-length // 8) * 8
            yield kind, content[begin : begin + length]
            place = following

    def _number(self, content: bytes, place: int) -> int:
        return int(struct.unpack_from(f"{self.byte_order}I", content, place)[0])


def elements_of(content: bytes) -> Iterator[Element]:
    """Yield the elements of a file in memory; raises ValueError or struct.error if cut off."""
    order = "<" if content[126:128] == b"IM" else ">"
    place = _HEADER_BYTES
    while place < len(content):
        kind, length = struct.unpack_from(f"{order}II", content, place)
        if length == 0 or place + 8 + length > len(content):
            raise ValueError("an element reaches beyond the file")
        yield Element(order, kind, content[place + 8 : place + 8 + length])
        place += 8 + length
