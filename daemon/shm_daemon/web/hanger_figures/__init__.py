"""The figures of the hanger page. A new one: a file with a `FIGURE`, and a line in `FIGURES`."""

from __future__ import annotations

from shm_daemon.web.hanger_figures.of_models import (
    BEFORE_AND_AFTER,
    CAUSES,
    FREQUENCIES,
    GAP_MAP,
    GAP_PLACES,
    MODELS,
    PAIRS,
    HangerFigure,
)
from shm_daemon.web.hanger_figures.over_time import STIFFNESS, TEMPERATURE, TREND

__all__ = ["FIGURES", "HangerFigure"]

FIGURES: tuple[HangerFigure, ...] = (
    TREND,
    STIFFNESS,
    TEMPERATURE,
    FREQUENCIES,
    MODELS,
    PAIRS,
    GAP_MAP,
    GAP_PLACES,
    CAUSES,
    BEFORE_AND_AFTER,
)
"""In reading order."""
