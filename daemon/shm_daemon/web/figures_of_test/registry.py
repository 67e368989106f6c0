"""The figures of a test page in reading order. A new one: a file with a `FIGURE`, and a line."""

from __future__ import annotations

from shm_daemon.web.figures_of_test.contract import TestFigure
from shm_daemon.web.figures_of_test.damping import FIGURE as DAMPING
from shm_daemon.web.figures_of_test.hits import FIGURE as HITS
from shm_daemon.web.figures_of_test.response import FIGURE as RESPONSE
from shm_daemon.web.figures_of_test.shapes import FIGURE as SHAPES
from shm_daemon.web.figures_of_test.stabilisation import FIGURE as STABILISATION
from shm_daemon.web.figures_of_test.time_history import FIGURE as TIME_HISTORY

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
