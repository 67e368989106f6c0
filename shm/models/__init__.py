"""The model classes of a hanger: parameters to frequencies and shapes.

A new class is one file and one line in `MODELS`.
"""

from __future__ import annotations

from shm.errors import UsageError
from shm.models.base import Model
from shm.models.beam import Beam1, Beam2
from shm.values import Hanger

MODELS: dict[str, type[Model]] = {model.name: model for model in (Beam1, Beam2)}


def build(name: str, hanger: Hanger) -> Model:
    """The model class `name` of `hanger`; raises UsageError for an unknown name."""
    if name not in MODELS:
        raise UsageError(f"unknown model class {name!r}.", remedy=f"Known: {', '.join(MODELS)}.")
    return MODELS[name](hanger)


__all__ = ["MODELS", "Model", "build"]
