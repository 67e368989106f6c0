"""Which hangers of a bridge may have a cause in common: those that are alike in something.

What a description says is compared as written: hangers of one delivery, of one section, with ends
alike, of about one length, and those measured in one round of tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

from shm.gap.shared_evidence import Patient

LEAST = 2
"""Members of a family: one alone shares nothing."""

_CLASSES = 2.0
"""Lengths are of one class from one power of the root of this to the next: judgement, ends of
hangers as unlike as that are mostly made otherwise."""


@dataclass(frozen=True)
class Kin:
    """Hangers, by their index, and in words what they have in common."""

    likeness: str
    members: tuple[int, ...]


def kin(patients: Sequence[Patient]) -> tuple[Kin, ...]:
    """All hangers, then the parts of them that are alike in something; each set of hangers once."""
    found = {tuple(range(len(patients))): "all hangers"}
    for likeness, of in _LIKENESSES.items():
        parts: dict[Hashable, list[int]] = {}
        for index, each in enumerate(patients):
            if (key := of(each)) is not None:
                parts.setdefault(key, []).append(index)
        for members in parts.values():
            if len(members) >= LEAST:
                found.setdefault(tuple(members), likeness)
    return tuple(Kin(likeness, members) for members, likeness in found.items())


def _round(each: Patient) -> Hashable | None:
    """The days on which it was tested; None where a test does not say."""
    days = {test.time.date() if test.time else None for test in each.tests}
    return None if None in days else frozenset(days)


def _length(each: Patient) -> Hashable:
    return math.floor(math.log(each.hanger.length_m) / math.log(_CLASSES) * 2)


_LIKENESSES: dict[str, Callable[[Patient], Hashable | None]] = {
    "hangers of one delivery": lambda each: each.hanger.family or None,
    "hangers of one section": lambda each: (
        each.hanger.area_m2,
        each.hanger.second_moment_m4,
        each.hanger.mass_per_length_kg_m,
        each.hanger.elastic_modulus_pa,
    ),
    "hangers with ends alike": lambda each: (
        each.hanger.plate,
        each.hanger.supports,
        each.hanger.fittings_m,
    ),
    "hangers tested on the same days": _round,
    "hangers of about one length": _length,
}
