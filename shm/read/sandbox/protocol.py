"""Values through a pipe: an .npz of arrays with a header in JSON; never a pickle.

The header is {"refused", "found"}; in it an array is {"array": name}. What is received becomes a
value by the types that its class declares.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from shm.documents import compact, finite, reader, value_of
from shm.errors import BadInput

_HEADER = "header"

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Answer:
    """Hold the result of a reader, not yet checked against the request."""

    refused: bool
    found: Any
    arrays: Mapping[str, NDArray[Any]]

    def listed(self) -> list[Any]:
        """Return the nodes of a list of values; raises ValueError where there is none."""
        if not isinstance(self.found, list) or not all(isinstance(n, dict) for n in self.found):
            raise ValueError("it lists nothing")
        return self.found

    def value(self, kind: type[T], node: object) -> T:
        """Return a node as a value, each part of the type that it must be; raises ValueError."""

        def array(node: Any, kind: Any) -> NDArray[Any]:
            found = self.arrays.get(str(node.get("array"))) if isinstance(node, dict) else None
            if found is None or found.dtype != np.dtype(get_args(get_args(kind)[1])[0]):
                raise ValueError("an array is not there, or of another type")
            return found

        by = reader(finite)
        by.register_structure_hook_func(_is_array, array)
        return value_of(kind, node, by=by)

    def refusal(self) -> BadInput:
        """Return the BadInput that the reader raised."""
        line = self.found["line"]
        texts = {key: str(self.found[key]) for key in ("file", "channel", "remedy")}
        return BadInput(
            str(self.found["message"]), line=line if isinstance(line, int) else None, **texts
        )


def _is_array(kind: Any) -> bool:
    return get_origin(kind) is np.ndarray


def refusal_document(error: BadInput) -> dict[str, object]:
    """Return a refusal with its texts cut to what anybody reads and a database takes."""
    texts = {"message": error.message, "remedy": error.remedy, "channel": error.channel[:500]}
    plain = {
        key: "".join(c if c.isprintable() or c == "\n" else "?" for c in text[:2000])
        for key, text in texts.items()
    }
    return {**plain, "file": error.file[:5000], "line": error.line}


def send(found: object, pipe: int, *, refused: bool, most_bytes: int) -> bool:
    """Write an answer into a pipe; return False, and write nothing, where it is larger."""
    arrays: dict[str, NDArray[Any]] = {}
    header = compact({"refused": refused, "found": _node(found, arrays)}).encode()
    if len(header) + sum(array.nbytes for array in arrays.values()) > most_bytes:
        return False
    packed: dict[str, Any] = {_HEADER: np.frombuffer(header, np.uint8), **arrays}
    with os.fdopen(pipe, "wb", closefd=False) as stream:
        np.savez(stream, **packed)
    return True


def _node(value: object, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return a value as `compact` takes it; arrays are put among the others."""
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        kind = np.complex128 if value.dtype.kind == "c" else np.float64
        arrays[name] = np.ascontiguousarray(value, dtype=kind)
        return {"array": name}
    if is_dataclass(value):
        return {each.name: _node(getattr(value, each.name), arrays) for each in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _node(each, arrays) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_node(each, arrays) for each in value]
    return value.item() if isinstance(value, np.generic) else value


def decoded(raw: bytes) -> Answer:
    """Return the answer behind the first byte; raises ValueError where there is none."""
    try:
        stream = io.BytesIO(raw)
        with zipfile.ZipFile(stream) as archive:
            if sum(member.file_size for member in archive.infolist()) > len(raw):
                raise ValueError("it unpacks to more than was sent")
        stream.seek(1)
        with np.load(stream, allow_pickle=False) as packed:
            arrays = {name: packed[name] for name in packed.files}
        header = json.loads(arrays.pop(_HEADER).tobytes())
        return Answer(header["refused"] is True, header["found"], arrays)
    except Exception as error:
        raise ValueError("its answer is none") from error
