"""Watching a hanger: how far tension, end stiffness and gap have moved, and when to say so."""

from __future__ import annotations

from shm.watch.drift import assess, decide, end_stiffness
from shm.watch.gap import gap_percent, has_grown, joined, watch_gap

__all__ = [
    "assess",
    "decide",
    "end_stiffness",
    "gap_percent",
    "has_grown",
    "joined",
    "watch_gap",
]
