"""The figures of the hanger page. A new one: a file with a `FIGURE`, and a line in `FIGURES`."""

from __future__ import annotations

from shm_daemon.web.hanger_figures.before_and_after import FIGURE as BEFORE_AND_AFTER
from shm_daemon.web.hanger_figures.causes import FIGURE as CAUSES
from shm_daemon.web.hanger_figures.frequencies import FIGURE as FREQUENCIES
from shm_daemon.web.hanger_figures.gap_map import FIGURE as GAP_MAP
from shm_daemon.web.hanger_figures.gap_places import FIGURE as GAP_PLACES
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.models import FIGURE as MODELS
from shm_daemon.web.hanger_figures.pairs import FIGURE as PAIRS
from shm_daemon.web.hanger_figures.stiffness import FIGURE as STIFFNESS
from shm_daemon.web.hanger_figures.temperature import FIGURE as TEMPERATURE
from shm_daemon.web.hanger_figures.trend import FIGURE as TREND

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
