"""The catalogue of physical effects; a new one is one file and one line in `EFFECTS`."""

from __future__ import annotations

from shm.models.base import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.effects.catalogue import EFFECTS
from shm.models.effects.owner import check_effect_priors, parameters_of

__all__ = [
    "EFFECTS",
    "Conditions",
    "Effect",
    "Parameter",
    "Survey",
    "Variant",
    "check_effect_priors",
    "parameters_of",
]
