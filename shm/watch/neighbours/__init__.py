"""The pattern over the bridge: which hangers gained and lost tension, and what explains it best."""

from __future__ import annotations

from shm.watch.neighbours.pattern import bridge_pattern, shifts_of
from shm.watch.neighbours.pattern_types import (
    BridgePattern,
    Explanation,
    HangerRow,
    HangerShift,
    NeighbourOptions,
    NotCompared,
    SumKept,
    Suspect,
)

__all__ = [
    "BridgePattern",
    "Explanation",
    "HangerRow",
    "HangerShift",
    "NeighbourOptions",
    "NotCompared",
    "SumKept",
    "Suspect",
    "bridge_pattern",
    "shifts_of",
]
