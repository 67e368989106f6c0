"""Where the gap lies: residuals by plane and order, place along the hanger, what it goes with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from shm.report import words
from shm.report.content import NORMAL_90
from shm.report.diagnosis.content import DiagnosisSheet
from shm.report.diagnosis.figures.below_map import (
    CLEAR_SD,
    goes_with,
    known,
    local,
    profiles,
)
from shm.report.diagnosis.figures.modes import aside, kept, measured, panels
from shm.report.diagnosis.phrases import title
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.values import Residual

_SPREAD = 0.62
"""Width over which the tests of one mode stand side by side, in orders."""
_EDGE = 0.12
"""Room above and below the map for what lies beyond it, as a share of its height."""
_MAP_INCHES = 2.7
_BELOW_INCHES = 2.2


def _draw(sheet: DiagnosisSheet) -> Figure | None:
    residuals = measured(sheet)
    if not residuals:
        return None
    below = [draw for draw, there in ((profiles, local), (goes_with, known)) if there(sheet)]
    inches = _BELOW_INCHES if profiles in below else 0.9 + 0.3 * len(known(sheet))
    figure = style.new_figure(_MAP_INCHES + (inches if below else 0))
    upper, lower = _halves(figure, inches) if below else (figure, None)
    made = panels(upper, residuals, "measured / baseline - 1 (%)")
    for plane, axes in made.items():
        ordinary = [r for r in kept(sheet) if r.plane == plane]
        if ordinary:
            _marks(axes, ordinary, sheet.diagnosis.tests)
    for plane, axes in made.items():
        _set_aside(axes, [r for r in aside(sheet) if r.plane == plane], sheet.diagnosis.tests)
    style.legend_of_figure(upper, list(made.values()), columns=3)
    if lower is not None:
        widths = (1.6, 1.0) if len(below) == 2 else (1.0,)
        row = lower.subplots(1, len(below), width_ratios=widths, squeeze=False)[0]
        for draw, axes in zip(below, row, strict=True):
            draw(axes, sheet)
    return figure


def _halves(figure: Figure, below_inches: float) -> tuple[FigureBase, FigureBase]:
    ratios = (_MAP_INCHES, below_inches)
    halves = figure.subfigures(2, 1, height_ratios=ratios, squeeze=False)
    for half in halves[:, 0]:
        half.set_facecolor("none")
    return halves[0, 0], halves[1, 0]


def _marks(axes: Axes, residuals: Sequence[Residual], tests: Sequence[str]) -> None:
    """A mark for each test beside the others of its mode, filled where the gap is clear."""
    colour = style.PLANE_COLOURS[residuals[0].plane]
    marker = style.PLANE_MARKERS[residuals[0].plane]
    x = np.array([r.order + _offset(r.test, tests) for r in residuals])
    y = np.array([r.residual_percent for r in residuals])
    sd = np.array([_sd_percent(r) for r in residuals])
    z = np.abs([r.z for r in residuals])
    barred = np.isfinite(sd)
    axes.vlines(
        x[barred], (y - NORMAL_90 * sd)[barred], (y + NORMAL_90 * sd)[barred], color=colour,
        linewidth=0.8, alpha=0.7,
    )  # fmt: skip
    size = 4.6 if len(tests) <= 6 else 3.2
    kinds = (
        (z >= CLEAR_SD, marker, colour, "beyond 2 sd"),
        (z < CLEAR_SD, marker, "none", "within 2 sd"),
        (np.isnan(z), "x", "none", "sd not known"),
    )
    for chosen, symbol, face, what in kinds:
        if chosen.any():
            axes.plot(
                x[chosen], y[chosen], linestyle="none", marker=symbol, markersize=size,
                markerfacecolor=face, markeredgecolor=colour, markeredgewidth=1.0,
                label=what,
            )  # fmt: skip


def _set_aside(axes: Axes, residuals: Sequence[Residual], tests: Sequence[str]) -> None:
    """Gross errors as crosses with their size, at the edge where they lie beyond the others."""
    if not residuals:
        return
    low, high = axes.get_ylim()
    margin = _EDGE * (high - low)
    axes.set_ylim(low - margin, high + margin)
    x = [r.order + _offset(r.test, tests) for r in residuals]
    y = [min(max(r.residual_percent, low), high) for r in residuals]
    axes.plot(
        x, y, linestyle="none", marker="X", markersize=7, color=style.RED, label="set aside",
    )  # fmt: skip
    for each, across, up in zip(residuals, x, y, strict=True):
        left = across > float(np.mean(axes.get_xlim()))
        axes.annotate(
            f"{each.residual_percent:+z.2f} %",
            (across, up),
            xytext=(-7 if left else 7, 0),
            textcoords="offset points",
            ha="right" if left else "left",
            va="center",
            fontsize=style.TINY,
            color=style.RED,
        )


def _offset(test: str, tests: Sequence[str]) -> float:
    if test not in tests or len(tests) < 2:
        return 0.0
    return _SPREAD * (tests.index(test) / (len(tests) - 1) - 0.5)


def _sd_percent(residual: Residual) -> float:
    """The standard deviation that the z-score was counted in."""
    return abs(residual.residual_percent / residual.z) if residual.z else math.nan


def _caption(sheet: DiagnosisSheet) -> str:
    tests = len(sheet.diagnosis.tests)
    order = " The tests of one mode stand side by side in their order." if tests > 1 else ""
    profiles = (
        " Below: where along the hanger a local cause of each kind would have to sit, with the "
        "share of the misfit that it would explain there."
        if local(sheet)
        else ""
    )
    trends = (
        " Diamonds: how the mean gap changes over the range of a condition, with 90 % intervals."
        if known(sheet)
        else ""
    )
    crosses = (
        " Crosses: gross errors, set aside; at the edge where they lie beyond it."
        if aside(sheet)
        else ""
    )
    return (
        f"Measured frequency over what the baseline {sheet.diagnosis.baseline} predicts at its "
        "best, less 1, by plane and order. Bars: 90 % interval of the measurement and of what the "
        f"baseline leaves open; filled: beyond 2 standard deviations.{crosses}{order}{profiles}"
        f"{trends}"
    )


def _alt(sheet: DiagnosisSheet) -> str:
    residuals = measured(sheet)
    worst = sorted(residuals, key=lambda r: -abs(r.residual_percent))[:3]
    told = ", ".join(f"{r.plane} {r.order} in {r.test} {r.residual_percent:+z.2f} %" for r in worst)
    places = "; ".join(
        f"as {title(place.kind)} it would sit at {words.number(place.x_m, '.2f')} m"
        for place in local(sheet)
    )
    there = f" Along the hanger: {places}." if places else ""
    count = words.counted(len(residuals), "residual")
    gross = ", ".join(f"{r.plane} {r.order} in {r.test}" for r in aside(sheet))
    set_aside = f" Set aside as a gross error: {gross}." if gross else ""
    return f"{count} of frequencies; the largest: {told}.{set_aside}{there}"


FIGURE = Member("gap_map", "Where the gap lies", _draw, _caption, _alt)
