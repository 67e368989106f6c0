"""Posterior of the tension: a histogram, its 90 % interval, nominal and baseline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures import style
from shm.report.figures.specification import Member
from shm.values.rounding import ForceUnit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NEAR = 1.5
"""How far from the samples a line may lie to be in view, in widths of the samples' range."""


def _draw(data: HangerReport) -> Figure:
    unit = data.tension_unit
    figure, axes = style.one_panel(f"tension ({unit.name})", f"probability density (1/{unit.name})")
    _histogram(axes, data)
    _see(axes, data)
    _line(axes, data.hanger.nominal_tension_n, unit, "nominal", style.INK, ":", 0.9)
    if data.baseline_tension_n is not None:
        baseline = data.baseline_tension_n.in_unit(unit)
        axes.axvspan(baseline.low, baseline.high, color=style.GREEN, alpha=0.15, linewidth=0)
        _line(axes, data.baseline_tension_n.mean, unit, "baseline", style.GREEN, "--", 0.8)
    style.legend_above(axes)
    return figure


def _see(axes: Axes, data: HangerReport) -> None:
    """Shows the samples and the lines near them: a sharp posterior must stay readable."""
    low, high = data.compared.tension_n.min(), data.compared.tension_n.max()
    lines = [data.hanger.nominal_tension_n]
    if (baseline := data.baseline_tension_n) is not None:
        lines += [baseline.low, baseline.high]
    reach = _NEAR * (high - low)
    seen = [low, high, *(line for line in lines if low - reach <= line <= high + reach)]
    margin = 0.05 * (max(seen) - min(seen))
    unit = data.tension_unit
    axes.set_xlim(unit.of(min(seen) - margin), unit.of(max(seen) + margin))


def _line(
    axes: Axes,
    tension_n: float,
    unit: ForceUnit,
    label: str,
    colour: str,
    dashes: str,
    height: float,
) -> None:
    """A tension as a line or, where it lies out of view, in words at the edge it lies beyond."""
    low, high = axes.get_xlim()
    tension = unit.of(tension_n)
    if low <= tension <= high:
        axes.axvline(tension, color=colour, linestyle=dashes, label=label)
        return
    right = tension > high
    named = f"{label} {tension:.{unit.decimals(tension_n)}f} {unit.name}"
    axes.text(
        0.99 if right else 0.01,
        height,
        f"{named} →" if right else f"← {named}",
        transform=axes.transAxes,
        color=colour,
        fontsize=9,
        ha="right" if right else "left",
    )


def _histogram(axes: Axes, data: HangerReport) -> None:
    samples = data.tension_unit.of(data.compared.tension_n)
    interval = data.tension_n.in_unit(data.tension_unit)
    heights, edges = np.histogram(samples, bins=min(40, 10 + len(samples) // 40), density=True)
    centres = (edges[:-1] + edges[1:]) / 2
    inside = (centres >= interval.low) & (centres <= interval.high)
    for mask, alpha, label in ((inside, 0.9, "90 % interval"), (~inside, 0.35, "outside it")):
        axes.bar(
            centres[mask],
            heights[mask],
            width=np.diff(edges)[mask] * 0.94,
            color=style.BLUE,
            alpha=alpha,
            linewidth=0,
            label=label,
        )


def _caption(data: HangerReport) -> str:
    tension = formatting.tension(data.tension_n, data.tension_unit)
    baseline = (
        "There is no earlier baseline."
        if data.baseline_tension_n is None
        else "Dashed: mean of the baseline, its 90 % interval shaded."
    )
    return (
        f"Tension by the latest test: {tension}. Dark bars lie in the 90 % interval. "
        f"Dotted: nominal tension. {baseline} What lies out of view is named at the edge."
    )


def _alt(data: HangerReport) -> str:
    tension = formatting.tension(data.tension_n, data.tension_unit)
    return f"Histogram of {len(data.posterior.samples)} posterior samples of tension, {tension}."


FIGURE = Member("tension", "Posterior of the tension", _draw, _caption, _alt)
