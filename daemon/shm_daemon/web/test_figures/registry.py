"""The figures of a test page in reading order. A new one: a file with a `FIGURE`, and a line."""

from __future__ import annotations

from shm_daemon.web.test_figures.contract import TestFigure
from shm_daemon.web.test_figures.damping import FIGURE as DAMPING
from shm_daemon.web.test_figures.hits import FIGURE as HITS
from shm_daemon.web.test_figures.response import FIGURE as RESPONSE
from shm_daemon.web.test_figures.shapes import FIGURE as SHAPES
from shm_daemon.web.test_figures.stabilisation import FIGURE as STABILISATION
from shm_daemon.web.test_figures.time_history import FIGURE as TIME_HISTORY

MEMBERS: tuple[TestFigure, ...] = (
    RESPONSE,
    TIME_HISTORY,
    HITS,
    STABILISATION,
    SHAPES,
    DAMPING,
)
FIGURES = {figure.name: figure for figure in MEMBERS}
FROM_RECORDS = tuple(figure for figure in MEMBERS if figure.source == "file")
