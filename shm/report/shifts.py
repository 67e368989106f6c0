"""A shift since the baseline in the cells of a table: percent of a tension, times a stiffness.

How tension and stiffness of a hanger go with the temperature, as far as its tests tell.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shm.report import formatting
from shm.report.formatting import Interval
from shm.report.paper import Table
from shm.report.states import StatesOverTime
from shm.values import NAN, Drift, FloatArray, TemperatureCoefficient, is_ratio, kind_of
from shm.values.rounding import ForceUnit, force_unit
from shm.watch.change_words import factor
from shm.watch.neighbours import BridgePattern, HangerRow

_UNMOVED = 0.01  # of the threshold: no test tells so little


def shift_cells(row: Drift) -> tuple[str, str, str, str, str]:
    """Quantity, shift, 90 % interval, threshold, probability beyond it."""
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
    """The one unit of all shifts of tension, and the decimals that they deserve.

    By the tensions that shift, not by the shifts: of hangers at rest they are all but 0.
    """
    largest_n = max(row.baseline_n for row in pattern.rows)
    unit = force_unit(largest_n)
    return unit, unit.decimals(largest_n)


def threshold_cell(row: Drift) -> str:
    """`5 %` of a tension or a frequency, `0.32 or 3.2 times` of a stiffness."""
    if is_ratio(row.quantity):
        return f"{100 * row.threshold:.3g} %"
    return f"{factor(-row.threshold)} or {factor(row.threshold)} times"


def _ratio(interval: Interval) -> tuple[str, str]:
    percent = interval.scaled(100)
    return f"{formatting.mean(percent, True)} %", f"{formatting.span(percent, True)} %"


def _stiffness(interval: Interval) -> tuple[str, str]:
    mean, low, high = (factor(each) for each in (interval.mean, interval.low, interval.high))
    return f"{mean} times", f"{low} to {high} times"


_BAR = 6  # layout: signs of a bar in a terminal


_PERCENT_DECIMALS = 1


def pattern_tables(pattern: BridgePattern) -> tuple[Table, Table]:
    """Each hanger's shift, and the explanations of all shifts together."""
    return shift_table(pattern), Table(
        "What explains them",
        ("explanation", "probability"),
        tuple(
            (each.name, formatting.probability(each.probability)) for each in pattern.explanations
        ),
    )


def shift_table(pattern: BridgePattern) -> Table:
    """Shifts of the tension since each hanger's baseline; those not compared stand last."""
    unit, places = shift_unit(pattern)
    rows = [_shift(row, unit, places) for row in pattern.rows]
    rows += [
        (str(each.hanger), "not known", "not known", "not compared", _day(each.time))
        for each in pattern.not_compared
    ]
    return Table(
        "Shifts along the bridge",
        ("hanger", f"shift, {unit.name} (90 %)", "shift, % (90 %)", "it has", "test of"),
        tuple(rows),
        note="Shift of the tension since the baseline at each hanger's latest test, if there is "
        "any, the swing with the temperature taken out, with 90 % intervals; whether it has lost "
        "or gained, with the probability of that.",
        terminal_column=(
            "lost | gained",
            *(bar(share) for share in _shares(pattern)),
            *("" for _ in pattern.not_compared),
        ),
    )


def _shares(pattern: BridgePattern) -> list[float]:
    """Of the largest shift."""
    widest = max(abs(row.shift_fraction) for row in pattern.rows) or 1.0
    return [row.shift_fraction / widest for row in pattern.rows]


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


def bar(share: float) -> str:
    """A share of the largest shift, -1 to 1, as `...<==|......`."""
    length = round(abs(share) * _BAR)
    stroke = "=" * (length - 1)
    left = f"<{stroke}" if share < 0 and length else ""
    right = f"{stroke}>" if share > 0 and length else ""
    return f"{left.rjust(_BAR, '.')}|{right.ljust(_BAR, '.')}"


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


TITLE = "Change with the temperature"
_WIDE_K = 10.0
_FEWEST = 3
"""Of two tests at two temperatures nobody can tell a swing from a change."""


def temperature_table(states: StatesOverTime) -> Table:
    """Each quantity's change per kelvin in percent of itself, or why it is not known."""
    why = _why_not_known(states)
    titles = {quantity.name: quantity.title for quantity in states.quantities}
    known = [_is_known(each, states) for each in states.temperature_coefficients]
    rows = tuple(
        _row(
            each, titles.get(each.quantity, formatting.quantity(each.quantity)), "" if sure else why
        )
        for each, sure in zip(states.temperature_coefficients, known, strict=True)
    )
    if len(rows) > 1 and not any(known):
        rows = (("tension and end stiffness", f"not known: {why}", ""),)
    return Table(
        TITLE,
        ("quantity", "change per K", "90 % interval"),
        rows,
        note="In percent of the quantity, mean and standard deviation, beside what the softening "
        "of steel explains (0.03 % of its modulus per K). States over time have this swing taken "
        "out; for the shifts the watch learns one of its own.",
    )


def temperature_documents(states: StatesOverTime) -> list[dict[str, Any]]:
    """Of each quantity its change per kelvin; `known` is false where no test says anything."""
    return [
        {
            "quantity": each.quantity,
            "unit": f"{kind_of(each.quantity).shift_unit} per K",
            "mean": each.mean,
            "sd": each.sd,
            "prior_sd": each.prior_sd,
            "known": _is_known(each, states),
            "why_not_known": "" if _is_known(each, states) else _why_not_known(states),
        }
        for each in states.temperature_coefficients
    ]


def _row(each: TemperatureCoefficient, title: str, why_not_known: str) -> tuple[str, ...]:
    if why_not_known:
        return (title, f"not known: {why_not_known}", "")
    scale = kind_of(each.quantity).percent_a_unit
    change = Interval.normal(each.mean, each.sd).scaled(scale)
    sd = f"{scale * each.sd:.{formatting.decimals(change.width)}f}"
    return (
        title,
        f"{formatting.mean(change, True)} ± {sd} % per K",
        f"{formatting.span(change, True)} % per K",
    )


def _is_known(each: TemperatureCoefficient, states: StatesOverTime) -> bool:
    """Whether the tests tell it, and are enough to tell it from a change."""
    return each.is_known and len(_known_c(states)) >= _FEWEST


def _known_c(states: StatesOverTime) -> FloatArray:
    """The temperatures (n,) of the tests that count."""
    return states.temperatures_c[np.isfinite(states.temperatures_c) & ~states.outlier]


def _why_not_known(states: StatesOverTime) -> str:
    known = _known_c(states)
    if len(known) < 2:
        return f"{formatting.counted(len(known), 'test')} with a temperature"
    span_k = float(np.ptp(known))
    if span_k >= _WIDE_K:
        return f"{len(known)} tests over {span_k:.0f} K are too few to tell it from other changes"
    return f"the temperatures of the tests differ by {span_k:.1f} K only"
