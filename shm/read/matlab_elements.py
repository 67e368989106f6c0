"""The elements of a MATLAB file of version 5, measured before scipy.io takes them.

An element is a tag of type and length. scipy.io looks types up unchecked, so that a damaged one
ends the process; and a compressed element may unpack to any size, whatever its variable's shape
says. So parts are checked, and what comes out is counted (MAT-File Format, MathWorks, chapter 1).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from shm.read.limits import limits

_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_INT8, _INT32, _UINT32 = 1, 5, 6
_NUMBER_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
_TEXTS = (1, 2, 4, 16, 17, 18)
_COMPLEX_FLAG = 0x800
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Element:
    """One variable of a file, still packed."""

    byte_order: str
    kind: int
    packed: bytes

    @property
    def is_complex(self) -> bool:
        """Whether its values are complex; ValueError where the head is damaged."""
        (kind, flags), dimensions, name = self._head(next(self.pieces()))
        if (kind, len(flags), dimensions[0], name[0]) != (_UINT32, 8, _INT32, _INT8):
            raise ValueError("the head of a variable is damaged")
        return bool(self._number(flags, 0) & _COMPLEX_FLAG)

    def pieces(self) -> Iterator[bytes]:
        """A matrix with its tag, unpacked piece by piece, until it outgrows the limit."""
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
        """Raises ValueError where the values are not what the shape says, or far too many."""
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

    def _head(self, piece: bytes) -> list[tuple[int, bytes]]:
        """Flags, dimensions and name of a matrix, each with its type."""
        parts = self._parts(piece)
        return [next(parts, (0, b"")) for _ in range(3)]

    def _parts(self, content: bytes) -> Iterator[tuple[int, bytes]]:
        """Type and content of each part of a matrix."""
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
    """The elements of a file in memory; ValueError or struct.error where they do not fit in."""
    order = "<" if content[126:128] == b"IM" else ">"
    place = _HEADER_BYTES
    while place < len(content):
        kind, length = struct.unpack_from(f"{order}II", content, place)
        if length == 0 or place + 8 + length > len(content):
            raise ValueError("an element reaches beyond the file")
        yield Element(order, kind, content[place + 8 : place + 8 + length])
        place += 8 + length
