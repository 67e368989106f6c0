"""The one decision on which of several weighed causes leads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

MIN_NO_GAP_PROBABILITY = 0.05
"""A gap is not stated while "no gap" keeps this probability: a 95 % interval leaves out as much."""


class WeighedCause(Protocol):
    """A cause with its probability and the index of its group of indistinguishable causes."""

    @property
    def probability(self) -> float:
        """Return the probability of this cause alone."""

    @property
    def group(self) -> int | None:
        """Return the index of its group, None for none."""


_Cause = TypeVar("_Cause", bound=WeighedCause)


def sum_group_probability(cause: WeighedCause, causes: Iterable[WeighedCause]) -> float:
    """Return the probability of a cause and of all that the data cannot tell from it."""
    if cause.group is None:
        return cause.probability
    return sum(each.probability for each in causes if each.group == cause.group)


def find_leading_cause(
    no_gap: float, unexplained: float, causes: Sequence[_Cause]
) -> _Cause | None:
    """Return the most probable cause of the most probable group; None where no cause leads.

    None leads while no gap keeps ``MIN_NO_GAP_PROBABILITY``, or while the unknown is as probable.
    """
    if no_gap >= MIN_NO_GAP_PROBABILITY or not causes:
        return None
    best = max(causes, key=lambda each: (sum_group_probability(each, causes), each.probability))
    return best if sum_group_probability(best, causes) > unexplained else None
