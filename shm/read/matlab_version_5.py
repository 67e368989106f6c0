"""The door to scipy.io: the variables of a MATLAB file of version 5 (save -v6, -v7)."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from numpy.typing import NDArray

from shm.errors import BadInput
from shm.read.arrays import Arrays, Variable
from shm.read.content import bytes_of
from shm.read.guard import guarded
from shm.read.limits import refuse_large
from shm.read.matlab_elements import Element, elements_of

_matlab: Any = scipy.io  # its stubs know no streams
_MOST_VARIABLES = 1000
_KINDS = {
    "double": ("f", 8), "single": ("f", 4), "char": ("U", 4), "int8": ("i", 1), "uint8": ("u", 1),
    "int16": ("i", 2), "uint16": ("u", 2), "int32": ("i", 4), "uint32": ("u", 4),
    "int64": ("i", 8), "uint64": ("u", 8),
}  # fmt: skip


def arrays_in(path: Path) -> Arrays:
    """Variables of numbers and texts, others left out; raises BadInput for sizes beyond limits."""
    content = bytes_of(path)
    with guarded(path):
        elements = tuple(elements_of(content))
        complexities = [element.is_complex for element in elements]
        listed = _matlab.whosmat(io.BytesIO(content))
        if len(listed) != len(elements) or len(listed) > _MOST_VARIABLES:
            raise ValueError("there are not as many variables as elements")
    _refuse_doubles([name for name, _, _ in listed], path)
    found = [
        _variable(name, shape, kind, is_complex, element, content, path)
        for (name, shape, kind), element, is_complex in zip(
            listed, elements, complexities, strict=True
        )
        if kind in _KINDS
    ]
    left_out = tuple(f"{name} ({kind})" for name, _, kind in listed if kind not in _KINDS)
    return Arrays(tuple(found), {}, left_out)


def write(arrays: dict[str, Any], path: Path) -> None:
    """Writes variables to a new file."""
    with path.open("wb") as stream:
        _matlab.savemat(stream, arrays, long_field_names=True, oned_as="column")


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
        found = _matlab.loadmat(io.BytesIO(content), variable_names=[name])
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
