"""The names of the catalogue's effects."""

from __future__ import annotations

from shm.models.effects import EFFECTS


def all_but(*kept: str) -> tuple[str, ...]:
    """Every effect but some: what a quick diagnosis is made without."""
    return tuple(name for name in EFFECTS if name not in kept)
