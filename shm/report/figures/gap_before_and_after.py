"""The frequencies before and after a gap diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shm.report import formatting
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_wording import (
    label,
)
from shm.report.figures import specification as spec
from shm.report.figures.gap_map import by_plane, orders, planes, retained
from shm.values import Plane, Residual

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class _Series:
    """One of the residuals of a mode; an empty colour is that of the plane."""

    field: str
    label: str
    symbol: spec.Symbol
    filled: bool
    colour: str
    offset: float


# Layout: where the marks of each series stand beside a mode.
_SERIES = (
    _Series("residual_percent", "baseline", "circle", False, "quiet", -0.2),
    _Series("after_percent", "with the cause", "circle", True, "", 0.0),
    _Series("held_out_after_percent", "with the cause, held out", "diamond", True, "green", 0.2),
)


def specify(sheet: DiagnosisSheet, is_on_screen: bool = False) -> spec.Specification | None:
    residuals = [r for r in retained(sheet) if math.isfinite(r.after_percent)]
    if not residuals or sheet.diagnosis.verdict.claim is None:
        return None
    made = {
        plane: [
            points
            for series in _SERIES
            if (points := _points([r for r in residuals if r.plane == plane], plane, series))
        ]
        for plane in planes(residuals)
    }
    label = "gap (%)" if is_on_screen else "measured / predicted - 1 (%)"
    ends = [end for marks in made.values() for each in marks for end in (each.low, each.high)]
    rows = by_plane(made, residuals, spec.Axis(label=label, range=spec.limits(*ends)), is_on_screen)
    return spec.Specification(rows=rows, height_inches=3.0, legend_columns=3)


def _points(residuals: Sequence[Residual], plane: Plane, series: _Series) -> spec.Points | None:
    """Return the mean over the tests with a line from the least to the largest."""
    there = [
        (order, values)
        for order in orders(residuals, plane)
        if len(values := _values(residuals, order, series.field))
    ]
    if not there:
        return None
    return spec.Points(
        x=[order + series.offset for order, _ in there],
        y=[float(np.mean(values)) for _, values in there],
        low=[min(values) for _, values in there], high=[max(values) for _, values in there],
        caps=False, symbol=series.symbol, filled=series.filled, name=series.label,
        colour=series.colour or spec.PLANE_HUES[plane],
        hover=f"{plane}, {series.label}: %{{y:.2f}} %",
    )  # fmt: skip


def _values(residuals: Sequence[Residual], order: int, field: str) -> list[float]:
    found = [getattr(r, field) for r in residuals if r.order == order]
    return [value for value in found if math.isfinite(value)]


def _caption_of_before_and_after(sheet: DiagnosisSheet) -> str:
    claim = sheet.diagnosis.verdict.claim
    assert claim is not None
    held_out = any(math.isfinite(r.held_out_after_percent) for r in sheet.diagnosis.where)
    diamonds = (
        " Diamonds: the same where the mode or its test was held out of the fit; a gap that "
        "shrinks only where it was fitted has not shrunk."
        if held_out
        else " Nothing was held out of the fit."
    )
    return (
        f"Open: the gap of each mode by the baseline {sheet.diagnosis.baseline}. Filled: with "
        f"{label(claim.leading)}.{diamonds} Marks are means over the tests, lines go from the "
        "least to the largest."
    )


def _alt_of_before_and_after(sheet: DiagnosisSheet) -> str:
    found = retained(sheet)
    wording = [
        f"{plane} from {_rms(found, plane, 'residual_percent')} to "
        f"{_rms(found, plane, 'after_percent')}"
        for plane in planes(found)
    ]
    return f"Root mean square of the gap by mode before and after: {'; '.join(wording)}."


def _rms(residuals: Sequence[Residual], plane: Plane, field: str) -> str:
    values = [getattr(r, field) for r in residuals if r.plane == plane]
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    return f"{formatting.plain(float(np.sqrt(np.mean(np.square(known)))), 2)} %"


BEFORE_AND_AFTER = spec.FigureSpec(
    "before_and_after",
    "The gap before and after by mode",
    specify,
    _caption_of_before_and_after,
    _alt_of_before_and_after,
)
