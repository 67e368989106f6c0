"""What may change together: each quantity alone, the ends' springs that one cause loosens.

A pin that wears, or a bolt that comes loose, takes stiffness from its end in both planes. Such a
change shifts the logarithms of the stiffnesses about alike, so that in units of each spring's
step, which is what so many decades do, it is about the same for all of them. How nearly is not
known: before any data the shifts of a joint change go together with a correlation of 0.8.

Where a spring stands for both ends of a plane and one of them loosens, a part of it is read as
tension (see readings.py). The other plane tells that from tension unless it loosens, too: then
springs and tension move together, the tension by any amount of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.values import TENSION, End, FloatArray, WatchedQuantity

_CORRELATION = 0.8
_ENDS: tuple[End, ...] = ("deck", "arch")


@dataclass(frozen=True, eq=False)
class Direction:
    """One way to change: the numbers of the quantities that move, the others stay.

    `root` (q, members) is a factor of the covariance of the shifts in steps, before any data.
    """

    members: tuple[int, ...]
    root: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Of the shifts of all quantities (q, q), 0 of those that stay."""
        return self.root @ self.root.T


def directions_of(quantities: Sequence[WatchedQuantity]) -> tuple[Direction, ...]:
    """Each quantity alone, in their order; then springs of one end, of both, those with tension.

    A spring of which the data do not tell the end may belong to either. What is one spring alone,
    or the same springs again, is left out.
    """
    everything = range(len(quantities))
    springs = [j for j in everything if quantities[j].name != TENSION]
    of_ends = [[j for j in springs if quantities[j].end in (end, None)] for end in _ENDS]
    joint = dict.fromkeys(tuple(each) for each in (*of_ends, springs) if len(each) > 1)
    is_read_as_tension = any(len(quantities[j].parameters) > 1 for j in springs)
    mixed = [tuple(everything)] if joint and is_read_as_tension else []
    chosen = dict.fromkeys([*((j,) for j in everything), *joint, *mixed])
    return tuple(direction_of(each, springs, len(quantities)) for each in chosen)


def direction_of(members: tuple[int, ...], springs: Sequence[int], q: int) -> Direction:
    """Of the quantities `members` among q, of which the `springs` move about alike."""
    n = len(members)
    among = np.eye(n)
    alike = np.isin(members, springs)
    among[np.ix_(alike, alike)] += _CORRELATION * (1 - np.eye(int(alike.sum())))
    root = np.zeros((q, n))
    root[list(members)] = np.linalg.cholesky(among)
    return Direction(members, root)
