"""How often the truth lies in the intervals that are given."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import colours
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial.figures.points import name_richness, of_richness, points
from shm.report.trial_scores import find, value
from shm.values import MarkName, TrialScore

_PANELS: tuple[tuple[MarkName, str, float], ...] = (
    ("tension covered", "tension, 95 % interval", 0.95),
    ("size covered", "effect's size, 90 % interval", 0.90),
)


def _draw(score: TrialScore) -> Figure | None:
    shown = [panel for panel in _PANELS if of_richness(score, panel[0])]
    if not shown:
        return None
    figure = style.new_figure(2.8)
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for axes, (name, title, nominal) in zip(panels, shown, strict=True):
        _panel(axes, score, name, nominal)
        axes.set_title(title, fontsize=9, color=colours.INK, loc="left")
    panels[0].set_ylabel("share that holds the truth", fontsize=9, color=colours.INK)
    return figure


def _panel(axes: Axes, score: TrialScore, name: MarkName, nominal: float) -> None:
    style.dress(axes, "", "")
    found = of_richness(score, name)
    mark = find(score, name)
    if mark and math.isfinite(mark.lower + mark.upper):
        axes.axhspan(mark.lower, mark.upper, color=colours.GREEN, alpha=0.15, linewidth=0)
    axes.axhline(nominal, color=colours.QUIET, linestyle=":", linewidth=1.0)
    points(axes, range(len(found)), [each for _, each in found], colours.BLUE)
    name_richness(axes, [richness for richness, _ in found])
    lowest = min((each.low for _, each in found if math.isfinite(each.low)), default=0.5)
    axes.set_ylim(min(0.5, axes.get_ylim()[0], lowest - 0.05), 1.03)


def _caption(score: TrialScore) -> str:
    return (
        "Left: how often the 95 % interval of the tension holds the truth, over all cases. Right: "
        "how often the 90 % interval of a single effect's size does, where its place was found. "
        "Dotted: the nominal share; shaded: what is asked over all data. Bars: 90 % intervals."
    )


def _alt(score: TrialScore) -> str:
    told = []
    for name, title, _ in _PANELS:
        shares = [f"{richness} {value(each)}" for richness, each in of_richness(score, name)]
        told.append(f"{title}: {', '.join(shares) or 'not known'}")
    return f"Coverage by richness of data. {'; '.join(told)}."


FIGURE = Member("trial_coverage", "Do the intervals hold the truth?", _draw, _caption, _alt)
