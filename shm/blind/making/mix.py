"""Which cases a trial consists of: fixed proportions, shuffled."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import get_args

import numpy as np

from shm.values import MIX, FloatArray, IntArray, PlantedKind, Richness, Way

# Judgement: most of what campaigns measure as a rule (frequencies, shapes, everything), some of
# what lies between; a twelfth of 480 cases is 40, whose shares are known to 0.13.
RICHNESSES: dict[Richness, float] = {
    "one plane": 1 / 12,
    "two planes": 1 / 4,
    "known mass": 1 / 12,
    "shapes": 1 / 4,
    "conditions": 1 / 12,
    "everything": 1 / 4,
}
WAYS: tuple[Way, ...] = get_args(Way)


@dataclass(frozen=True)
class Draft:
    """A case before anything is drawn for it.

    `share` (0 to 1) is where its size lies in the range of sizes; `effects` are names in the order
    in which they are tried.
    """

    case: str
    kind: PlantedKind
    richness: Richness
    way: Way
    share: float
    effects: tuple[str, ...]


def drafts(
    cases: int,
    ways: Sequence[Way],
    effects: Sequence[str],
    unlisted: Sequence[str],
    rng: np.random.Generator,
) -> tuple[Draft, ...]:
    """The cases of a trial in an order that says nothing.

    Within each kind and richness sizes are spread evenly over their range, and every effect takes
    its turn at being tried first.
    """
    kinds, richnesses = tuple(MIX), tuple(RICHNESSES)
    wanted = np.multiply.outer(
        np.outer(list(MIX.values()), list(RICHNESSES.values())), np.full(len(ways), 1 / len(ways))
    )
    groups = defaultdict(list)
    for kind, richness, way in balanced(wanted, cases):
        groups[kinds[kind], richnesses[richness]].append(ways[way])
    found = []
    for (name, rich), members in groups.items():
        known = unlisted if name == "unknown" else effects
        shares = (rng.permutation(len(members)) + rng.uniform(size=len(members))) / len(members)
        orders = _turns(known, len(members), rng)
        for place, share, order in zip(rng.permutation(len(members)), shares, orders, strict=True):
            found.append((name, rich, members[place], float(share), order))
    shuffled = [found[place] for place in rng.permutation(len(found))]
    return tuple(Draft(f"c{i + 1:04d}", *each) for i, each in enumerate(shuffled))


def balanced(wanted: FloatArray, count: int) -> list[tuple[int, ...]]:
    """`count` cells of a table of proportions, so that all its margins are as near as they can be.

    One cell after the other: the one whose margins, of every order, lack most.
    """
    axes = range(wanted.ndim)
    margins = [
        tuple(set(axes) - set(kept))
        for order in range(1, wanted.ndim + 1)
        for kept in combinations(axes, order)
    ]
    taken: IntArray = np.zeros(wanted.shape, dtype=np.int64)
    cells = []
    for done in range(1, count + 1):
        lack = wanted * done - taken
        total = sum(lack.sum(axis=over, keepdims=True) for over in margins)
        cell = np.unravel_index(int(np.argmax(np.broadcast_to(total, wanted.shape))), wanted.shape)
        taken[cell] += 1
        cells.append(tuple(int(each) for each in cell))
    return cells


def _turns(names: Sequence[str], count: int, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """For each of `count` cases all names in random order, each first equally often."""
    firsts: list[str] = []
    while len(firsts) < count:
        firsts += [str(name) for name in rng.permutation(list(names))]
    orders = []
    for first in firsts[:count]:
        rest = rng.permutation([name for name in names if name != first])
        orders.append((first, *(str(name) for name in rest)))
    return orders
