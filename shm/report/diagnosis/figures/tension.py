"""The tension with its interval by the baseline alone and with the cause."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import colours
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_wording import AFTER, tension_of, tension_unit, tension_words
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.values import TensionEstimate
from shm.values.force_units import ForceUnit

_NEAR = 1.0
"""How far the nominal tension may lie to be in view, in widths of what is drawn."""


def _draw(sheet: DiagnosisSheet) -> Figure | None:
    rows = _rows(sheet)
    if not rows:
        return None
    figure = style.new_figure(0.42 * len(rows) + 0.95)
    axes = figure.subplots()
    unit = tension_unit(sheet.diagnosis)
    style.dress(axes, f"tension ({unit.name})", "")
    for row, (_, estimate, colour) in enumerate(rows):
        _interval(axes, row, estimate, unit, colour)
    axes.set_yticks(range(len(rows)), [told for told, _, _ in rows])
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    axes.set_ylim(len(rows) - 0.5, -0.75)
    axes.margins(x=0.12)
    axes.ticklabel_format(axis="x", useOffset=False)
    _nominal(axes, unit.of(sheet.hanger.nominal_tension_n))
    return figure


def _rows(sheet: DiagnosisSheet) -> list[tuple[str, TensionEstimate, str]]:
    diagnosis = sheet.diagnosis
    rows = [
        (f"baseline {diagnosis.baseline}", diagnosis.tension_before_n, colours.QUIET),
        (AFTER, diagnosis.tension_after_n, colours.BLUE),
    ]
    return [row for row in rows if math.isfinite(row[1].mean)]


def _interval(
    axes: Axes, row: int, estimate: TensionEstimate, unit: ForceUnit, colour: str
) -> None:
    interval = tension_of(estimate).in_unit(unit)
    if math.isfinite(interval.width):
        axes.plot(
            [interval.low, interval.high], [row, row], color=colour, linewidth=7, alpha=0.35,
            solid_capstyle="butt",
        )  # fmt: skip
    axes.plot([interval.mean], [row], marker="o", markersize=6, color=colour)
    axes.annotate(
        tension_words(estimate, unit),
        (interval.mean, row),
        xytext=(0, 9),
        textcoords="offset points",
        ha="center",
        fontsize=style.TINY + 0.5,
        color=colours.INK,
    )


def _nominal(axes: Axes, nominal: float) -> None:
    """The nominal tension as a line, where it lies near."""
    low, high = axes.get_xlim()
    reach = _NEAR * (high - low)
    if not low - reach <= nominal <= high + reach:
        return
    axes.axvline(nominal, color=colours.INK, linestyle=":", linewidth=1.2, label="nominal")
    margin = 0.08 * (high - low)
    axes.set_xlim(min(low, nominal - margin), max(high, nominal + margin))
    style.legend_above(axes)


def _caption(sheet: DiagnosisSheet) -> str:
    return (
        f"Tension by the baseline alone and {AFTER}: mean and 90 % interval. Where the two bars do "
        "not overlap, the gap moves the tension by more than the baseline admits. The interval "
        "holds what the scatter of manufacture leaves open."
    )


def _alt(sheet: DiagnosisSheet) -> str:
    unit = tension_unit(sheet.diagnosis)
    told = [f"{what} {tension_words(estimate, unit)}" for what, estimate, _ in _rows(sheet)]
    return f"Tension before and after, mean and 90 % interval: {'; '.join(told)}."


FIGURE = Member("gap_tension", "Tension before and after", _draw, _caption, _alt)
