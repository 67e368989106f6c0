"""The catalogue of physical effects; a new one is one file and one line in `EFFECTS`."""

from __future__ import annotations

from shm.models.effects.base import Conditions, Effect, Parameter, Survey, Variant

__all__ = ["Conditions", "Effect", "Parameter", "Survey", "Variant"]
