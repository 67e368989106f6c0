"""What effects that grow with the amplitude ask of the tests."""

from __future__ import annotations

from shm.models.effects.base import Survey

_LEAST_RATIO = 1.2


def missing_levels(survey: Survey) -> str:
    """Why an effect of the amplitude cannot be seen; empty where the levels differ enough."""
    levels = survey.amplitudes
    if levels and max(levels) >= _LEAST_RATIO * min(levels):
        return ""
    return "It takes tests at two known levels, one at least 1.2 times the other."
