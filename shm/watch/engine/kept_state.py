"""The states that a watch goes on from, as bytes: JSON, and the bytes of all arrays after it."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import datetime
from functools import partial
from typing import Any, TypeVar, get_args, get_origin

import cattrs
import numpy as np

from shm.documents import reader, value_of
from shm.errors import BadInput

T = TypeVar("T")


def to_bytes(state: object) -> bytes:
    """Return a frozen value of numbers, texts, times, arrays and other such values as bytes."""
    arrays: list[np.ndarray[Any, Any]] = []
    head = json.dumps(_plain(state, arrays)).encode()
    return zlib.compress(head + b"\n" + b"".join(each.tobytes() for each in arrays), 1)


def from_bytes(kind: type[T], content: bytes) -> T:
    """Return the value that `to_bytes` wrote; raises BadInput where the content is none."""
    try:
        head, _, rest = zlib.decompress(content).partition(b"\n")
        return value_of(kind, json.loads(head), by=_reader_of(rest))
    except (zlib.error, TypeError, ValueError) as error:
        raise BadInput(
            f"A kept state of the watch cannot be read: {error!r}.",
            remedy="Drop it: the watch then starts again.",
        ) from error


def _plain(node: object, arrays: list[np.ndarray[Any, Any]]) -> object:
    if isinstance(node, np.ndarray):
        at = sum(each.nbytes for each in arrays)
        arrays.append(node)
        return [at, node.dtype.str, node.shape]
    if is_dataclass(node):
        return {each.name: _plain(getattr(node, each.name), arrays) for each in fields(node)}
    if isinstance(node, Mapping):
        return [[_plain(part, arrays) for part in item] for item in node.items()]
    if isinstance(node, list | tuple | frozenset):
        return [_plain(each, arrays) for each in node]
    return node.isoformat() if isinstance(node, datetime) else node


def _is_of(origin: Any, kind: Any) -> bool:
    return get_origin(kind) is origin


def _reader_of(rest: bytes) -> cattrs.Converter:
    """Return a converter whose arrays are parts of `rest`."""

    def array(node: Any, _: Any) -> np.ndarray[Any, Any]:
        at, kind, shape = node
        return np.frombuffer(rest, kind, math.prod(shape), at).reshape(shape)

    def mapping(node: Any, kind: Any) -> dict[Any, Any]:
        key, value = get_args(kind)
        return {made.structure(k, key): made.structure(v, value) for k, v in node}

    made = reader()
    for origin, hook in ((np.ndarray, array), (Mapping, mapping)):
        made.register_structure_hook_func(partial(_is_of, origin), hook)
    return made
