"""The gap of each mode by the baseline, with the cause, and with the cause fitted without it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.diagnosis.content import DiagnosisSheet, claimed
from shm.report.diagnosis.figures.modes import kept, orders, panels, planes
from shm.report.diagnosis.phrases import label
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.values import Plane, Residual


@dataclass(frozen=True)
class _Series:
    """One of the residuals of a mode: the field that holds it, how it looks, where it stands."""

    field: str
    label: str
    marker: str
    filled: bool
    offset: float


_SERIES = (
    _Series("residual_percent", "baseline", "o", False, -0.2),
    _Series("after_percent", "with the cause", "o", True, 0.0),
    _Series("held_out_after_percent", "with the cause, held out", "D", True, 0.2),
)


def _draw(sheet: DiagnosisSheet) -> Figure | None:
    residuals = [r for r in kept(sheet) if math.isfinite(r.after_percent)]
    if not residuals or claimed(sheet.diagnosis) is None:
        return None
    figure = style.new_figure(3.0)
    made = panels(figure, residuals, "measured / predicted - 1 (%)")
    for plane, axes in made.items():
        for series in _SERIES:
            _points(axes, [r for r in residuals if r.plane == plane], plane, series)
    style.legend_of_figure(figure, list(made.values())[:1], columns=3)
    return figure


def _points(axes: Axes, residuals: Sequence[Residual], plane: Plane, series: _Series) -> None:
    """The mean over the tests with a line from the least to the largest."""
    there = [
        (order, values)
        for order in orders(residuals, plane)
        if len(values := _values(residuals, order, series.field))
    ]
    if not there:
        return
    x = np.array([order + series.offset for order, _ in there])
    colour = _colour(plane, series)
    axes.vlines(
        x, [min(v) for _, v in there], [max(v) for _, v in there], color=colour, linewidth=1.0,
        alpha=0.6,
    )  # fmt: skip
    axes.plot(
        x, [float(np.mean(v)) for _, v in there], linestyle="none", marker=series.marker,
        markersize=5 if series.marker == "o" else 4, color=colour,
        markerfacecolor=colour if series.filled else "none", label=series.label,
    )  # fmt: skip


def _values(residuals: Sequence[Residual], order: int, field: str) -> list[float]:
    found = [getattr(r, field) for r in residuals if r.order == order]
    return [value for value in found if math.isfinite(value)]


def _colour(plane: Plane, series: _Series) -> str:
    if series.field == "residual_percent":
        return style.QUIET
    return style.GREEN if series.marker == "D" else style.PLANE_COLOURS[plane]


def _caption(sheet: DiagnosisSheet) -> str:
    claim = claimed(sheet.diagnosis)
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


def _alt(sheet: DiagnosisSheet) -> str:
    found = kept(sheet)
    told = [
        f"{plane} from {_rms(found, plane, 'residual_percent')} to "
        f"{_rms(found, plane, 'after_percent')}"
        for plane in planes(found)
    ]
    return f"Root mean square of the gap by mode before and after: {'; '.join(told)}."


def _rms(residuals: Sequence[Residual], plane: Plane, field: str) -> str:
    values = [getattr(r, field) for r in residuals if r.plane == plane]
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    return f"{words.plain(float(np.sqrt(np.mean(np.square(known)))), 2)} %"


FIGURE = Member("before_and_after", "The gap before and after by mode", _draw, _caption, _alt)
