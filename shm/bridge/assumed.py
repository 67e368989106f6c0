"""The tables `[assumptions]` and `[hanger.assumptions]`: rows that an owner states otherwise.

A row is overridden by its number (`accelerometer_mass_kg = 0.2`), a range by two of them
(`end_restraint = [3, 1000]`), and either by a table that may give a reason too
(`{value = 0.2, sd = 0.05, reason = "weighed"}`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from shm.assumptions import DEFAULTS, FILE, Assumption, Assumptions, number_text
from shm.bridge.table import Table
from shm.errors import suggest

_ALL_ROWS = "`shm settings --assumptions` lists all."
_NUMBERS = {
    "value": "number",
    "sd": "standard deviation",
    "lower": "low end",
    "upper": "high end",
}
"""What a message calls each; it must not repeat a key, by which its line is found."""


def assumptions_of(table: Table | None, base: Assumptions, origin: str = FILE) -> Assumptions:
    """Return the table of assumptions with the rows that `table` states.

    Raises BadInput where a row is unknown or cannot be as stated.
    """
    if table is None:
        return base
    return base.with_rows(*(_row(table, key, base, origin) for key in table.values))


def _row(table: Table, key: str, base: Assumptions, origin: str) -> Assumption:
    if key not in base:
        raise table.refusal(f"unknown assumption {key}", suggest(key, base) + _ALL_ROWS)
    row, raw = base[key], table.values[key]
    stated = _numbers(table, row, raw)
    unexplained = f"Stated without a reason; the default is {number_text(DEFAULTS[key])}."
    reason = raw.get("reason", unexplained) if isinstance(raw, dict) else unexplained
    if not isinstance(reason, str) or not reason.strip():
        raise table.refusal(f"{key}: reason is not a text", 'Write reason = "weighed in 2024".')
    found = replace(row, **stated, reason=reason, source=origin, origin=origin)
    _refuse_impossible(table, found)
    return found


def _numbers(table: Table, row: Assumption, raw: Any) -> dict[str, Any]:
    """Return what a key states, by the field of the row; raises BadInput for what the row lacks."""
    if isinstance(raw, dict):
        given = {key: value for key, value in raw.items() if key != "reason"}
        if unknown := sorted(set(given) - set(_NUMBERS)):
            raise table.refusal(f"{row.name}: unknown key {unknown[0]}", _how(row))
    elif isinstance(raw, list):
        if len(raw) != 2:
            raise table.refusal(f"{row.name} = {raw!r} is not two numbers", _how(row))
        given = {"lower": raw[0], "upper": raw[1]}
    else:
        given = {"value": raw}
    lacking = [key for key in given if math.isnan(getattr(row, key))]
    if lacking or not given:
        what = f"has no {_NUMBERS[lacking[0]]}" if lacking else "states no number"
        raise table.refusal(f"{row.name} {what}", _how(row))
    for number in given.values():
        is_number = isinstance(number, int | float) and not isinstance(number, bool)
        if not is_number or not math.isfinite(number):
            raise table.refusal(f"{row.name}: {number!r} is not a number", _how(row))
    return {key: float(number) for key, number in given.items()}


def _refuse_impossible(table: Table, row: Assumption) -> None:
    for key in ("value", "lower", "upper"):
        number = getattr(row, key)
        if not math.isnan(number) and not row.least <= number <= row.most:
            what = f"a {_NUMBERS[key]} of {number:g} {_unit(row)}".rstrip()
            allowed = f"from {row.least:g} to {row.most:g}"
            raise table.refusal(f"{row.name}: {what} is not {allowed}", _how(row))
    if row.has_sd and not row.least_sd <= row.sd <= row.most_sd:
        _refuse_sd(table, row)
    if row.has_range and not row.lower < row.upper:
        raise table.refusal(f"{row.name}: {row.lower:g} to {row.upper:g} does not rise", _how(row))


def _refuse_sd(table: Table, row: Assumption) -> None:
    """Raise BadInput of a standard deviation that cannot be, or does not go with the value."""
    raw = table.values[row.name]
    is_stated = isinstance(raw, dict) and "sd" in raw
    bounded = math.isfinite(row.most_sd)
    allowed = (
        f"from {row.least_sd:g} to {row.most_sd:.3g}" if bounded else f"{row.least_sd:g} or more"
    )
    of_value = f" beside a value of {row.value:g}" if bounded else ""
    which = "a" if is_stated else "its unchanged"
    what = f"{row.name}: {which} standard deviation of {row.sd:g}{of_value} is not {allowed}"
    if is_stated:
        raise table.refusal(what, _how(row))
    example = f"{row.name} = {{value = {row.value:g}, sd = {row.most_sd / 2:.2g}}}"
    raise table.refusal(what, f"Give the standard deviation too, such as {example}.")


def _how(row: Assumption) -> str:
    """Return how to write a row; the example is the default."""
    row = DEFAULTS[row.name]
    if row.has_value:
        example = f"{row.name} = {row.value:g}"
        more = [f"{key} = .." for key in tuple(_NUMBERS)[1:] if not math.isnan(getattr(row, key))]
        keys = ", ".join(("value = ..", *more, 'reason = ".."'))
        how = f"Write {example}, or a table {{{keys}}}"
    else:
        how = f"Write {row.name} = [{row.lower:g}, {row.upper:g}]"
    unit = f", in {_unit(row)}" if _unit(row) else ""
    return f"{how}{unit} (default {number_text(row)})."


def _unit(row: Assumption) -> str:
    return "" if row.unit == "1" else row.unit
