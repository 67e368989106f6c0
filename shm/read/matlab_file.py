"""MATLAB .mat files: version 5 (save -v6, -v7) by our own reader, version 7.3 by h5py.

Variables are those of `arrays`: force, acc_1, sampling_rate_hz, acc_1_unit, acc_1_x_m, ...
A struct of one element counts as its fields. Objects, functions and cells are left out unread.

A file of version 5 is a row of elements: a tag of type and length, then a matrix that may be packed
(MAT-File Format, MathWorks, chapter 1). scipy.io ends the process on damaged ones
(docs/decisions/0023).
"""

from __future__ import annotations

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
from numpy.typing import NDArray

from shm.errors import BadInput
from shm.read.arrays import Arrays, Variable, unique_names
from shm.read.content import bytes_of
from shm.read.hdf5_file import opened_nodes, variables
from shm.read.limits import guarded, limits, refuse_large

_VERSION_5, _VERSION_7_3 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_INT8, _INT32, _UINT32 = 1, 5, 6
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_IN_ORDER = (4, 17, 18)
_KINDS = (
    "", "cell", "struct", "object", "char", "sparse", "double", "single", "int8", "uint8", "int16",
    "uint16", "int32", "uint32", "int64", "uint64", "function", "opaque",
)  # fmt: skip
_NUMBERS = _KINDS[6:16]
_COMPLEX, _LOGICAL = 0x800, 0x200
_HEAD_BYTES = 1 << 12  # technical: flags, dimensions and name
_MOST_VARIABLES = 1000
_MAX_FIELDS = 20  # judgement: a struct among more is settings of a program, no recording
_NAME_FIELDS = ("channel_names", "names", "channels", "labels")
_UNIT_FIELDS = ("unit", "units")
_OF = "\0"  # between a struct and its field, until names are told apart


def recognises(head: bytes) -> bool:
    return head.startswith((_VERSION_5, _VERSION_7_3))


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
    with path.open("rb") as stream:
        version_7_3 = stream.read(len(_VERSION_7_3)) == _VERSION_7_3
    if not version_7_3:
        yield _arrays(path)
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


# ---------------------------------------------------------------- version 5


@dataclass(frozen=True)
class Element:
    """One variable of a file, still packed where it is."""

    order: str
    kind: int
    content: bytes

    def matrix(self, *, head_alone: bool = False) -> _Matrix:
        """Return the matrix, or as much of it as shows its head; raises ValueError."""
        most_bytes = _HEAD_BYTES if head_alone else limits().bytes_at_once
        kind, content = self.kind, memoryview(self.content)
        if kind == _COMPRESSED:
            tag = zlib.decompressobj().decompress(self.content, 8)
            kind, length = struct.unpack(f"{self.order}II", tag)
            if length > most_bytes and not head_alone:
                raise ValueError("a variable unpacks to more than is read at once")
            unpacked = zlib.decompressobj().decompress(self.content, 8 + min(length, most_bytes))
            content = memoryview(unpacked)[8:]
        if kind != _MATRIX:
            raise ValueError("an element is no matrix")
        return _matrix(content[:most_bytes], self.order)


def elements_of(content: bytes) -> Iterator[Element]:
    """Yield the elements of a file; raises ValueError or struct.error where it is cut off."""
    order = "<" if content[126:128] == b"IM" else ">"
    place = _HEADER_BYTES
    while place < len(content):
        kind, length = struct.unpack_from(f"{order}II", content, place)
        if length == 0 or place + 8 + length > len(content):
            raise ValueError("an element reaches beyond the file")
        yield Element(order, kind, content[place + 8 : place + 8 + length])
        place += 8 + length


@dataclass(frozen=True)
class _Matrix:
    """A matrix by its head; `parts` are type and bytes of what follows."""

    order: str
    name: str
    kind: str
    shape: tuple[int, ...]
    is_complex: bool
    parts: Iterator[tuple[int, memoryview]]

    def values(self) -> NDArray[Any]:
        """Return numbers, or a text for each row; raises ValueError where they are damaged."""
        parts = list(self.parts)
        if len(parts) != 1 + self.is_complex:
            raise ValueError("a variable has too many or too few parts")
        if self.kind == "char":
            (kind, part), rows = parts[0], max(1, self.shape[0])
            ending = {"<": "-le", ">": "-be"}[self.order] if kind in _IN_ORDER else ""
            letters = bytes(part).decode(_ENCODINGS[kind] + ending)
            return np.array([letters[row::rows].rstrip() for row in range(rows)], dtype=str)
        rows_of = [self._numbers(*part) for part in parts]
        found = rows_of[0] + 1j * rows_of[1] if self.is_complex else rows_of[0]
        return found.reshape(self.shape, order="F")

    def _numbers(self, kind: int, part: memoryview) -> NDArray[Any]:
        found = np.frombuffer(part, self.order + _TYPES[kind])
        if found.size != math.prod(self.shape):
            raise ValueError("a variable's values are not as many as its shape says")
        return found.astype(self.kind)

    def fields(self) -> dict[str, NDArray[Any]]:
        """Return the fields of a struct of one element that hold numbers or texts."""
        (_, length), (_, names), *values = self.parts
        (size,) = struct.unpack(f"{self.order}I", length)
        keys = [
            bytes(names[n : n + size]).split(b"\0")[0].decode() for n in range(0, len(names), size)
        ]
        found = {}
        for key, (_, content) in zip(keys, values, strict=True):
            inner = _matrix(content, self.order) if content else None
            if inner is not None and inner.kind == "cell":
                cells = [_matrix(cell, self.order) for _, cell in inner.parts if cell]
                if all(cell.kind == "char" for cell in cells):
                    found[key] = np.array([" ".join(cell.values()) for cell in cells], dtype=str)
            elif inner is not None and inner.kind in (*_NUMBERS, "char"):
                found[key] = np.squeeze(inner.values())
        return found


def _matrix(content: memoryview, order: str) -> _Matrix:
    """Return a matrix by its head; raises ValueError where that is damaged."""
    parts = _parts(content, order)
    (kind, flags), dimensions = next(parts), next(parts)
    if kind != _UINT32 or len(flags) != 8:
        raise ValueError("the head of a variable is damaged")
    (flag,) = struct.unpack_from(f"{order}I", flags)
    named = _KINDS[flag & 0xFF]
    name = dimensions if named == "opaque" else next(parts)
    if name[0] != _INT8 or (named != "opaque" and dimensions[0] != _INT32):
        raise ValueError("the head of a variable is damaged")
    shape = () if named == "opaque" else tuple(np.frombuffer(dimensions[1], f"{order}i4").tolist())
    named = "logical" if flag & _LOGICAL else named
    return _Matrix(
        order, bytes(name[1]).decode("latin-1"), named, shape, bool(flag & _COMPLEX), parts
    )


def _parts(content: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and bytes of each part of a matrix; a short part stands within its tag."""
    place = 0
    while place + 8 <= len(content):
        kind, length = struct.unpack_from(f"{order}II", content, place)
        if kind >> 16:
            kind, length, begin, place = kind & 0xFFFF, kind >> 16, place + 4, place + 8
        else:
            begin = place + 8
            place = begin + -(-length // 8) * 8
        yield kind, content[begin : begin + length]


def _arrays(path: Path) -> Arrays:
    """Return the variables that are numbers or texts; raises BadInput beyond the limits."""
    content = bytes_of(path)
    with guarded(path):
        elements = list(elements_of(content))
        heads = [element.matrix(head_alone=True) for element in elements]
        if len(heads) > _MOST_VARIABLES:
            raise ValueError("there are far too many variables")
    names = [head.name for head in heads]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise BadInput(
            "occurs twice in the file.",
            file=path,
            channel=twice,
            remedy="Save each variable once.",
        )
    found: list[Variable] = []
    left_out: list[str] = []
    for head, element in zip(heads, elements, strict=True):
        if head.kind in (*_NUMBERS, "char"):
            found.append(_variable(head, element, path))
            continue
        fields = []
        if head.kind == "struct" and math.prod(head.shape) == 1 and len(heads) < _MAX_FIELDS:
            fields = _fields(head.name, element, path)
        found += fields
        left_out += [] if fields else [f"{head.name} ({head.kind})"]
    names = unique_names([tuple(variable.name.split(_OF)) for variable in found])
    apart = [replace(v, name=name) for v, name in zip(found, names, strict=True)]
    return Arrays(tuple(apart), {}, tuple(left_out))


def _variable(head: _Matrix, element: Element, path: Path) -> Variable:
    kind = np.dtype(np.str_ if head.kind == "char" else head.kind)
    item_bytes = 4 if head.kind == "char" else kind.itemsize * (1 + head.is_complex)
    refuse_large(head.shape, item_bytes, head.name, path)
    shape = head.shape[:1] if head.kind == "char" else head.shape
    letter = "c" if head.is_complex else kind.kind
    return Variable(head.name, shape, letter, item_bytes, lambda: element.matrix().values())


def _fields(name: str, element: Element, path: Path) -> list[Variable]:
    """Return the fields of a struct that hold numbers or a text; none where no record is in it.

    A field `unit` of as many texts as there are records gives the unit of each, in their order; one
    of names those of a table's columns.
    """
    with guarded(path, f"the struct {name!r}"):
        fields = element.matrix().fields()
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
    facts = {k: v for k, v in fields.items() if v.size == 1}
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
        if texts.size == count and texts.dtype.kind == "U":
            return tuple(map(str, texts))
    return ()
