"""Solid finite element models of a hanger and their reduction; the only door to scikit-fem."""

from __future__ import annotations

from shm.models.classes.solid.classes import S1, S2, Solid0, Solid1, Solid2

__all__ = ["S1", "S2", "Solid0", "Solid1", "Solid2"]
