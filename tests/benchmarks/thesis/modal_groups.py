"""Groups of modes with a model error of their own: thesis (4.7) to (4.12)."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from shm.errors import UsageError
from shm.values import IntArray, Mode

PLANE, ORDER, MODE = "plane", "order", "mode"
NAMED = (PLANE, ORDER, MODE)
_RANGE = re.compile(r"(\d+)(?:-(\d+))?")


def groups(modes: Sequence[Mode], sigma: str) -> dict[str, IntArray]:
    """Return the places (members,) of each group's modes, by what the group is called.

    `sigma` is "plane", "order" or "mode", or names groups of orders: "1-3,4-6". Raises UsageError
    where it is none of these, and where a mode is in no group.
    """
    ranges = () if sigma in NAMED else _ranges(sigma)
    called = [_called(mode, sigma, ranges) for mode in modes]
    return {
        name: np.flatnonzero([each == name for each in called]) for name in dict.fromkeys(called)
    }


def _called(mode: Mode, sigma: str, ranges: Sequence[tuple[int, int]]) -> str:
    if sigma in NAMED:
        names = {PLANE: mode.plane, ORDER: f"order {mode.order}"}
        return names.get(sigma, f"{mode.plane} {mode.order}")
    for first, last in ranges:
        if first <= mode.order <= last:
            return f"order {first}" if first == last else f"orders {first} to {last}"
    raise UsageError(
        f"--sigma {sigma}: order {mode.order} is in no group.",
        remedy="Name every measured order once: 1-3,4-6, say.",
    )


def _ranges(sigma: str) -> tuple[tuple[int, int], ...]:
    found = [_RANGE.fullmatch(part.strip()) for part in sigma.split(",")]
    ranges = tuple((int(m[1]), int(m[2] or m[1])) for m in found if m is not None)
    orders = [order for first, last in ranges for order in range(first, last + 1)]
    if None in found or any(first > last for first, last in ranges) or len(orders) > len({*orders}):
        raise UsageError(
            f"--sigma {sigma}: neither one of {', '.join(NAMED)}, nor orders in groups.",
            remedy="Write the orders of each group, each once: 1-3,4-6, say.",
        )
    return ranges
