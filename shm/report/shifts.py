"""A shift since the baseline in the cells of a table: percent of a tension, times a stiffness."""

from __future__ import annotations

import math

from shm.report import words
from shm.report.content import Interval
from shm.values import NAN, TENSION, Drift
from shm.values.force_units import ForceUnit, force_unit
from shm.watch.neighbours import BridgePattern

_UNMOVED = 0.01
_LARGEST_FACTOR = 1e3


def shift_cells(row: Drift) -> tuple[str, str, str, str, str]:
    """Quantity, shift, 90 % interval, threshold, probability beyond it."""
    if not math.isfinite(row.shift_mean + row.shift_sd):
        unknown = ("not known", "not known", threshold_cell(row), words.probability(NAN))
        return (words.quantity(row.quantity), *unknown)
    interval = Interval.normal(row.shift_mean, row.shift_sd)
    # Of the baseline's own test, and where the data leave no room for a shift.
    unmoved = row.shift_sd < _UNMOVED * row.threshold and abs(row.shift_mean) < row.threshold / 2
    size, span = _tension(interval) if row.quantity == TENSION else _stiffness(interval)
    return (
        words.quantity(row.quantity),
        "no change seen" if unmoved else size,
        _about_none(row) if unmoved else span,
        threshold_cell(row),
        words.probability(row.probability),
    )


def shift_unit(pattern: BridgePattern) -> tuple[ForceUnit, int]:
    """The one unit of all shifts of tension, and the decimals that they deserve.

    By the tensions that shift, not by the shifts: of hangers at rest they are all but 0.
    """
    largest_n = max(row.baseline_n for row in pattern.rows)
    unit = force_unit(largest_n)
    return unit, unit.decimals(largest_n)


def _about_none(row: Drift) -> str:
    return "about 0 %" if row.quantity == TENSION else "about 1.00 times"


def threshold_cell(row: Drift) -> str:
    """`5 %` of a tension, `0.32 or 3.2 times` of a stiffness."""
    if row.quantity == TENSION:
        return f"{100 * row.threshold:.3g} %"
    return f"{factor(-row.threshold)} or {factor(row.threshold)} times"


def factor(decades: float) -> str:
    """How many times what it was: `0.50`, `3.2`."""
    value = 10 ** min(decades, 300.0)
    if value > _LARGEST_FACTOR:
        return "more than 1000"
    if value < 1 / _LARGEST_FACTOR:
        return "less than 0.001"
    return f"{value:.2f}" if value < 2 else f"{value:.1f}" if value < 10 else f"{value:.0f}"


def _tension(interval: Interval) -> tuple[str, str]:
    percent = interval.scaled(100)
    return f"{words.mean(percent, True)} %", f"{words.span(percent, True)} %"


def _stiffness(interval: Interval) -> tuple[str, str]:
    mean, low, high = (factor(each) for each in (interval.mean, interval.low, interval.high))
    return f"{mean} times", f"{low} to {high} times"
