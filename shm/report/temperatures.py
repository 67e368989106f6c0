"""How tension and stiffness of a hanger go with the temperature, as far as its tests tell."""

from __future__ import annotations

from typing import Any

import numpy as np

from shm.report import formatting
from shm.report.intervals import Interval
from shm.report.paper import Table
from shm.report.states import StatesOverTime
from shm.values import FloatArray, TemperatureCoefficient, kind_of

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
