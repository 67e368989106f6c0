"""Posterior of the tension: a histogram, its 90 % interval, nominal and baseline."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.content import HangerReport, Interval
from shm.report.figures import style
from shm.report.figures.member import Member


def _draw(data: HangerReport) -> Figure:
    figure = style.new_figure()
    axes = figure.subplots()
    style.dress(axes, "tension (kN)", "probability density (1/kN)")
    _histogram(axes, data)
    axes.axvline(
        data.hanger.nominal_tension_n / 1e3, color=style.INK, linestyle=":", label="nominal"
    )
    if data.baseline_tension_n is not None:
        _baseline(axes, words.kilonewtons(data.baseline_tension_n))
    style.legend_above(axes)
    return figure


def _histogram(axes: Axes, data: HangerReport) -> None:
    samples = data.posterior.tension_n / 1e3
    interval = words.kilonewtons(data.tension_n)
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


def _baseline(axes: Axes, baseline: Interval) -> None:
    axes.axvspan(baseline.low, baseline.high, color=style.GREEN, alpha=0.15, linewidth=0)
    axes.axvline(baseline.mean, color=style.GREEN, linestyle="--", label="baseline")


def _caption(data: HangerReport) -> str:
    tension = words.with_interval(words.kilonewtons(data.tension_n), "kN")
    baseline = (
        "There is no earlier baseline."
        if data.baseline_tension_n is None
        else "Dashed: mean of the baseline, its 90 % interval shaded."
    )
    return (
        f"Tension by the latest test: {tension}. Dark bars lie in the 90 % interval. "
        f"Dotted: nominal tension. {baseline}"
    )


def _alt(data: HangerReport) -> str:
    tension = words.with_interval(words.kilonewtons(data.tension_n), "kN")
    return f"Histogram of {len(data.posterior.samples)} posterior samples of tension, {tension}."


FIGURE = Member("tension", "Posterior of the tension", _draw, _caption, _alt)
