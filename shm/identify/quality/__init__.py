"""Check the quality of a test: each check is a figure, its limit and what to do about it.

A check is a row of a table: a statistic, its limit, and three sentences.
"""

from __future__ import annotations

from collections.abc import Sequence

from shm.errors import NotIdentifiable
from shm.identify.quality import of_ambient, of_hits, of_modes, of_sensors, of_signals
from shm.identify.quality import tones as of_tones
from shm.identify.quality.table import Inspection, Row
from shm.identify.quality.tones import tones
from shm.values import QualityCheck

__all__ = ["CHECKS", "CHECKS_OF_NUMBERED", "Inspection", "Row", "assess", "refusal", "tones"]

CHECKS: tuple[Row, ...] = (
    of_hits.HITS,
    of_hits.DOUBLE_HITS,
    of_signals.UNITS,
    of_signals.CLIPPING,
    of_signals.CABLES,
    of_signals.DROP_OUTS,
    of_hits.PRE_TRIGGER,
    of_hits.RING_DOWN,
    of_hits.FORCE_SPECTRUM,
    of_modes.COHERENCE,
    of_modes.AMPLITUDE,
    of_signals.NOISE,
    *of_ambient.ROWS,
    of_tones.ROW,
    of_hits.REPEATABILITY,
    of_modes.AGREEMENT,
    of_sensors.DIRECTIONS,
)
CHECKS_OF_NUMBERED: tuple[Row, ...] = (of_modes.LOWEST, of_sensors.GAIN, of_sensors.PLACES)
"""Of modes that have orders, on a described bar."""


def assess(inspection: Inspection, rows: Sequence[Row] = CHECKS) -> tuple[QualityCheck, ...]:
    """Return the figures of all checks that apply, in the order of `rows`."""
    found = [row.check(inspection) for row in rows]
    return tuple(figure for figure in found if figure is not None)


def refusal(checks: Sequence[QualityCheck], source: str) -> NotIdentifiable | None:
    """Return what to raise for a test that a check refuses; None where none does."""
    refused = [check for check in checks if check.verdict == "refused"]
    if not refused:
        return None
    return NotIdentifiable(
        "; ".join(f"{check.name}: {check.found}" for check in refused) + ".",
        file=source,
        remedy=refused[0].remedy,
    )
