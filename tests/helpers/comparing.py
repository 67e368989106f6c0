"""Comparison of values by their fields.

`==` fails on NaN, which differs from itself, and on arrays; `repr` of many values is one line for
people, which leaves fields out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def assert_same(found: object, expected: object) -> None:
    """Fail with each place where two values differ; NaN equals NaN, arrays are equal by value."""
    different = differences(found, expected)
    assert not different, "\n".join(different)


def differences(found: Any, expected: Any, at: str = "value") -> list[str]:
    """Return a line for each place where two values differ: `value.modes[0].order: 1, 2`."""
    if isinstance(expected, np.ndarray) or isinstance(found, np.ndarray):
        return _of_arrays(found, expected, at)
    if type(found) is not type(expected):
        return [f"{at}: {type(found).__name__} {found!r}, {type(expected).__name__} {expected!r}"]
    if is_dataclass(expected):
        names = [field.name for field in fields(expected) if field.compare]
        return [
            line
            for name in names
            for line in differences(getattr(found, name), getattr(expected, name), f"{at}.{name}")
        ]
    if isinstance(expected, Mapping):
        if list(found) != list(expected):
            return [f"{at}: keys {list(found)}, {list(expected)}"]
        return [
            line
            for key, value in expected.items()
            for line in differences(found[key], value, f"{at}[{key!r}]")
        ]
    if isinstance(expected, Sequence) and not isinstance(expected, str | bytes):
        if len(found) != len(expected):
            return [f"{at}: {len(found)} items, {len(expected)}: {found!r}, {expected!r}"]
        return [
            line
            for index, pair in enumerate(zip(found, expected, strict=True))
            for line in differences(*pair, f"{at}[{index}]")
        ]
    if isinstance(expected, float | complex) and found != found and expected != expected:
        return []
    return [] if found == expected else [f"{at}: {found!r}, {expected!r}"]


def _of_arrays(found: Any, expected: Any, at: str) -> list[str]:
    if not (isinstance(found, np.ndarray) and isinstance(expected, np.ndarray)):
        return [f"{at}: {type(found).__name__}, {type(expected).__name__}"]
    if found.shape != expected.shape or found.dtype.kind != expected.dtype.kind:
        return [f"{at}: {found.dtype} {found.shape}, {expected.dtype} {expected.shape}"]
    same = np.array_equal(found, expected, equal_nan=found.dtype.kind in "fc")
    return [] if same else [f"{at}: {found}, {expected}"]
