"""Values through a pipe: a header in JSON, then the bytes of arrays; never a pickle.

An answer is a sign that the child is confined, eight bytes of length, the header {"refused",
"found", "arrays": [[dtype, shape]]}, and the arrays one after the other. In the header an array is
{"array": place}. The side that receives
checks every type against the fields of the value that it expects.
"""

from __future__ import annotations

import json
import math
import types
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import UTC, datetime
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from shm.errors import BadInput

BEGUN = b"+"
LENGTH_BYTES = 8  # technical: of a whole number of 64 bits
# judgement: 33 MB, more than any list of modal tests; arrays do not count
LARGEST_HEADER = 1 << 25
_DTYPES = ("<f8", "<c16")
# judgement: far above a refusal (2,000 characters) or a path (4,096)
_LONGEST_TEXT = 100_000
_LARGEST_WHOLE = 2**53  # beyond, numbers of double precision leave out whole ones

T = TypeVar("T")


@dataclass(frozen=True)
class Refused:
    """A BadInput, as it goes through the pipe."""

    message: str
    file: str
    channel: str
    line: int | None
    remedy: str


@dataclass(frozen=True, eq=False)
class Answer:
    """What a reader said, not yet checked against what was asked."""

    refused: bool
    found: Any
    arrays: tuple[NDArray[Any], ...]

    def listed(self) -> list[Any]:
        """The values found; raises ValueError where there is no list of them."""
        if not isinstance(self.found, list) or not self.found:
            raise ValueError("it lists nothing")
        return self.found


def refusal_as_value(error: BadInput) -> Refused:
    """A refusal, its texts cut to what anybody reads."""
    message, remedy, channel = map(_readable, (error.message, error.remedy, error.channel))
    return Refused(message, error.file[:5000], channel[:500], error.line, remedy)


def _readable(text: str) -> str:
    """A text of printable characters, not too long; databases refuse some of the others."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text[:2000])


def refusal_of(refused: Refused) -> BadInput:
    """The BadInput that a reader raised."""
    return BadInput(
        refused.message,
        file=refused.file,
        channel=refused.channel,
        line=refused.line,
        remedy=refused.remedy,
    )


# ---------------------------------------------------------------- sending


def encoded(found: object, *, refused: bool) -> tuple[bytes, list[NDArray[Any]]]:
    """Length and header of an answer, and the arrays whose bytes follow."""
    arrays: list[NDArray[Any]] = []
    node = _node(found, arrays)
    listed = [[array.dtype.str, list(array.shape)] for array in arrays]
    header = json.dumps({"refused": refused, "found": node, "arrays": listed}).encode()
    return len(header).to_bytes(LENGTH_BYTES, "little") + header, arrays


def _node(value: object, arrays: list[NDArray[Any]]) -> Any:
    """A value as JSON holds it; arrays are put aside."""
    if isinstance(value, np.ndarray):
        kind = "<c16" if value.dtype.kind == "c" else "<f8"
        arrays.append(np.ascontiguousarray(value, dtype=kind))
        return {"array": len(arrays) - 1}
    if is_dataclass(value):
        return {each.name: _node(getattr(value, each.name), arrays) for each in fields(value)}
    if isinstance(value, dict):
        return {str(key): _node(each, arrays) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_node(each, arrays) for each in value]
    if isinstance(value, np.generic):
        return value.item()
    return value.isoformat() if isinstance(value, datetime) else value


# ---------------------------------------------------------------- receiving


def header_of(raw: bytes) -> dict[str, Any]:
    """The header of an answer; raises ValueError where it is none."""
    try:
        header = json.loads(raw)
    except RecursionError as error:
        raise ValueError("its header is nested too deeply") from error
    if not isinstance(header, dict) or header.keys() != {"refused", "found", "arrays"}:
        raise ValueError("its header is none")
    if not isinstance(header["refused"], bool) or not isinstance(header["arrays"], list):
        raise ValueError("its header is none")
    return header


def bytes_of_arrays(header: dict[str, Any]) -> int:
    """How many bytes are to follow; raises ValueError for arrays that cannot be."""
    return sum(math.prod(shape) * dtype.itemsize for dtype, shape in _declared(header))


def arrays_of(header: dict[str, Any], raw: bytearray) -> tuple[NDArray[Any], ...]:
    """The arrays of an answer, as views of its bytes."""
    found, place = [], 0
    for dtype, shape in _declared(header):
        count = math.prod(shape)
        found.append(np.frombuffer(raw, dtype, count, place).reshape(shape))
        place += count * dtype.itemsize
    return tuple(found)


def _declared(header: dict[str, Any]) -> list[tuple[np.dtype[Any], tuple[int, ...]]]:
    found = []
    for entry in header["arrays"]:
        if not isinstance(entry, list) or len(entry) != 2 or entry[0] not in _DTYPES:
            raise ValueError("an array is of an unknown type")
        shape = entry[1]
        if not isinstance(shape, list) or not 1 <= len(shape) <= 2:
            raise ValueError("an array is no row and no table")
        if not all(type(n) is int and 0 < n < _LARGEST_WHOLE for n in shape):
            raise ValueError("an array has an impossible shape")
        found.append((np.dtype(entry[0]), tuple(shape)))
    return found


def value_of(kind: type[T], node: object, arrays: Sequence[NDArray[Any]]) -> T:
    """A node as a value of a kind, each part of the type that it must be; raises ValueError."""
    found: T = _value(kind, node, arrays)
    return found


def _value(kind: Any, node: Any, arrays: Sequence[NDArray[Any]]) -> Any:
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        inner = next(each for each in get_args(kind) if each is not type(None))
        return None if node is None else _value(inner, node, arrays)
    if origin is Literal:
        return _one_of(get_args(kind), node)
    if origin is tuple:
        inner = get_args(kind)[0]
        return tuple(_value(inner, each, arrays) for each in _of_type(list, node))
    if origin is np.ndarray:
        return _array(get_args(get_args(kind)[1])[0], node, arrays)
    return _fields(kind, node, arrays) if is_dataclass(kind) else _PLAIN[kind](node)


def _fields(kind: Any, node: Any, arrays: Sequence[NDArray[Any]]) -> Any:
    hints = _hints(kind)
    if _of_type(dict, node).keys() != hints.keys():
        raise ValueError(f"a {kind.__name__} lacks something or has too much")
    return kind(**{name: _value(hint, node[name], arrays) for name, hint in hints.items()})


@cache
def _hints(kind: Any) -> dict[str, Any]:
    known = get_type_hints(kind)
    return {each.name: known[each.name] for each in fields(kind)}


def _array(scalar: Any, node: Any, arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    place = _of_type(dict, node).get("array")
    if type(place) is not int or not 0 <= place < len(arrays):
        raise ValueError("an array is not there")
    if arrays[place].dtype != np.dtype(scalar):
        raise ValueError("an array is of another type")
    return arrays[place]


def _one_of(choices: Sequence[Any], node: Any) -> Any:
    if not isinstance(node, str) or node not in choices:
        raise ValueError("a word is none of those that are known")
    return node


def _of_type(kind: type[T], node: Any) -> T:
    if not isinstance(node, kind):
        raise ValueError(f"something is no {kind.__name__}")
    return node


def _text(node: Any) -> str:
    if len(_of_type(str, node)) > _LONGEST_TEXT:
        raise ValueError("a text is too long")
    return str(node)


def _whole(node: Any) -> int:
    if type(node) is not int or abs(node) > _LARGEST_WHOLE:
        raise ValueError("a number is not whole")
    return node


def _number(node: Any) -> float:
    """A finite number or NaN."""
    if type(node) not in (int, float) or abs(node) > 1e300:
        raise ValueError("a number is none")
    return float(node)


def _time(node: Any) -> datetime:
    time = datetime.fromisoformat(_of_type(str, node))
    if time.tzinfo is None:
        raise ValueError("a time is without zone")
    return time.astimezone(UTC)


_PLAIN: dict[Any, Any] = {
    str: _text, int: _whole, float: _number, bool: lambda node: _of_type(bool, node),
    datetime: _time,
}  # fmt: skip
