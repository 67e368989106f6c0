"""Roots by number: bisection on a count, then a bracketed secant (Anderson and Bjorck)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from shm.values import BoolArray, FloatArray, IntArray

Trial: TypeAlias = Callable[[FloatArray, IntArray], tuple[IntArray, FloatArray]]

_STEPS = 200
_LAST_STEP = 1e-12


def ordered_roots(trial: Trial, low: FloatArray, high: FloatArray, order: IntArray) -> FloatArray:
    """The root number `order` of each problem, shape (problems,), which lies from `low` to `high`.

    `trial(x, which)` tries the problems `which` (tried,) at `x` (tried,): how many roots lie below,
    and a smooth function that changes sign at each root. Method: N. Anderson and A. Bjorck, BIT 13
    (1973), in which the count alone decides on which side of the root a trial lies.
    """
    search = _Search(low, high, order)
    for _ in range(_STEPS):
        if not search.left.size:
            break
        x = search.proposal()
        search.learn(x, *trial(x, search.left))
    return search.root


class _Search:
    """Brackets of all problems; `left` are those not yet settled."""

    def __init__(self, low: FloatArray, high: FloatArray, order: IntArray):
        self.root = np.full(len(low), np.inf)
        self.left: IntArray = np.arange(len(low))
        self.order = order
        self.ends = np.array([low, high])
        self.values = np.ones_like(self.ends)
        self.below = np.array([order - 2, order + 1])
        self.side = np.full(len(low), -1)

    def proposal(self) -> FloatArray:
        """Where to try next, (left,): the middle until one root alone is bracketed."""
        low, high = self.ends
        value_low, value_high = self.values
        secant = (low * value_high - high * value_low) / np.where(
            self._alone(), value_high - value_low, 1.0
        )
        inside = self._alone() & (secant > low) & (secant < high)
        return np.asarray(np.where(inside, secant, (low + high) / 2))

    def _alone(self) -> BoolArray:
        return np.asarray(self.below[1] - self.below[0] == 1)

    def learn(self, x: FloatArray, below: IntArray, value: FloatArray) -> None:
        """Narrows the brackets by trials at `x` (left,) and drops what is settled."""
        column = np.arange(len(x))
        side = (below >= self.order).astype(np.int64)
        again = self._alone() & (side == self.side)
        shrink = 1 - value / self.values[side, column]
        shrink = np.where(shrink > 0, shrink, 0.5)
        self.values[1 - side, column] *= np.where(again, shrink, 1.0)
        self.ends[side, column], self.values[side, column] = x, value
        self.below[side, column], self.side = below, side
        moved = np.abs(x - self.root[self.left])
        self.root[self.left] = x
        width = self.ends[1] - self.ends[0]
        self._keep((np.minimum(moved, width) > _LAST_STEP * x) & (value != 0))

    def _keep(self, open_: BoolArray) -> None:
        self.left, self.order, self.side = self.left[open_], self.order[open_], self.side[open_]
        self.ends, self.values = self.ends[:, open_], self.values[:, open_]
        self.below = self.below[:, open_]
