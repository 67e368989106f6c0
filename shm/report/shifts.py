"""Shifts since the baseline in the cells of tables: those of a hanger, those along the bridge."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from shm.report import formatting
from shm.report.formatting import Interval
from shm.report.paper import Table, fold_improbable
from shm.values import NAN, Drift, is_ratio, kind_of
from shm.values.rounding import ForceUnit, force_unit
from shm.watch.neighbours import BridgePattern, HangerRow
from shm.watch.words.alert_text import factor

_UNMOVED = 0.01  # of the threshold: no test tells so little


def shift_cells(row: Drift) -> tuple[str, str, str, str, str]:
    """Return quantity, shift, 90 % interval, threshold, probability beyond it."""
    if not math.isfinite(row.shift_mean + row.shift_sd):
        unknown = ("not known", "not known", threshold_cell(row), formatting.probability(NAN))
        return (formatting.quantity(row.quantity), *unknown)
    interval = Interval.normal(row.shift_mean, row.shift_sd)
    # Of the baseline's own test, and where the data leave no room for a shift.
    unmoved = row.shift_sd < _UNMOVED * row.threshold and abs(row.shift_mean) < row.threshold / 2
    size, span = _ratio(interval) if is_ratio(row.quantity) else _stiffness(interval)
    return (
        formatting.quantity(row.quantity),
        "no change seen" if unmoved else size,
        kind_of(row.quantity).unmoved if unmoved else span,
        threshold_cell(row),
        formatting.probability(row.probability),
    )


def shift_unit(pattern: BridgePattern) -> tuple[ForceUnit, int]:
    """Return the one unit of all shifts of tension, and the decimals that they deserve.

    By the tensions that shift, not by the shifts: of hangers at rest they are all but 0.
    """
    largest_n = max(row.baseline_n for row in pattern.rows)
    unit = force_unit(largest_n)
    return unit, unit.decimals(largest_n)


def threshold_cell(row: Drift) -> str:
    """Return `5 %` of a tension or a frequency, `0.32 or 3.2 times` of a stiffness."""
    if is_ratio(row.quantity):
        return f"{100 * row.threshold:.3g} %"
    return f"{factor(-row.threshold)} or {factor(row.threshold)} times"


def _ratio(interval: Interval) -> tuple[str, str]:
    percent = interval.scaled(100)
    return f"{formatting.mean(percent, True)} %", f"{formatting.span(percent, True)} %"


def _stiffness(interval: Interval) -> tuple[str, str]:
    mean, low, high = (factor(each) for each in (interval.mean, interval.low, interval.high))
    return f"{mean} times", f"{low} to {high} times"


_PERCENT_DECIMALS = 1


def pattern_tables(pattern: BridgePattern) -> tuple[Table, Table]:
    """Return each hanger's shift, and the explanations of all shifts together."""
    return shift_table(pattern), Table(
        "What explains them",
        ("explanation", "probability"),
        fold_improbable(
            [(e.name, formatting.probability(e.probability)) for e in pattern.explanations],
            [each.probability for each in pattern.explanations],
            "explanations",
        ),
    )


def shift_table(pattern: BridgePattern) -> Table:
    """Return shifts of the tension since each hanger's baseline; the note names the others."""
    unit, places = shift_unit(pattern)
    others = ", ".join(str(each.hanger) for each in pattern.not_compared)
    return Table(
        "Shifts along the bridge",
        ("hanger", f"shift, {unit.name} (90 %)", "shift, % (90 %)", "it has", "test of"),
        tuple(_shift(row, unit, places) for row in pattern.rows),
        note="Shift of the tension since the baseline at each hanger's latest test, if there is "
        "any, without the effect of the temperature, with 90 % intervals; whether it has lost "
        "or gained, with the probability of that."
        + (f" Without a recent test, so not compared: {others}." if others else ""),
    )


def _shift(row: HangerRow, unit: ForceUnit, places: int) -> tuple[str, ...]:
    newtons = Interval(row.shift_n, row.low_n, row.high_n)
    fraction = Interval(row.shift_fraction, row.low_fraction, row.high_fraction)
    return (
        str(row.hanger),
        _signed(newtons.in_unit(unit), places),
        _signed(fraction.scaled(100), _PERCENT_DECIMALS),
        f"{row.way} ({formatting.probability(row.probability)})",
        _day(row.time),
    )


def _signed(interval: Interval, places: int) -> str:
    nothing = 0.5 * 10**-places
    if max(abs(interval.low), abs(interval.high)) < nothing:
        return f"{0:.{places}f} (within {nothing:.{places + 1}f})"
    mean, low, high = (
        f"{value:+z.{places}f}" for value in (interval.mean, interval.low, interval.high)
    )
    return f"{mean} ({low} to {high})"


def _day(time: object) -> str:
    return f"{time:%Y-%m-%d}" if time else "none"


PATTERN_SCHEMA = "shm.bridge_pattern/1"


def pattern_json(pattern: BridgePattern) -> dict[str, Any]:
    """Return the document that `shm drift bridge --json` prints."""
    return {"schema": PATTERN_SCHEMA, **asdict(pattern)}
