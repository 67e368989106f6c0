"""The log score by richness beside that of the prototype."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from shm.report import colours
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial.figures.points import name_richness, of_richness, points
from shm.report.trial_scores import find, value
from shm.values import Richness, TrialScore


def _prototype(score: TrialScore, richness: Richness) -> float:
    mark = find(score, "log score", richness=richness)
    return mark.upper if mark else math.inf


def _draw(score: TrialScore) -> Figure | None:
    found = of_richness(score, "log score")
    if not found:
        return None
    figure = style.new_figure(2.8)
    axes = figure.subplots()
    style.dress(axes, "", "log score")
    points(axes, range(len(found)), [each for _, each in found], colours.BLUE, "this trial")
    before = [_prototype(score, richness) for richness, _ in found]
    there = [(x, bound) for x, bound in enumerate(before) if math.isfinite(bound)]
    if there:
        axes.plot(
            *zip(*there, strict=True), linestyle="none", marker="D", markersize=5,
            color=colours.ORANGE, label="prototype: the mark to beat",
        )  # fmt: skip
    name_richness(axes, [richness for richness, _ in found])
    axes.set_ylim(bottom=0)
    style.legend_above(axes)
    return figure


def _caption(score: TrialScore) -> str:
    mark = find(score, "log score")
    size = f" Sizes above {mark.above:g}, and sound hangers." if mark and mark.above else ""
    return (
        "Mean of -ln of the probability that was given to the truth (no gap, the effect, the pair, "
        "unexplained), weighed to the mix of a quarter nothing, a half one, an eighth two and an "
        f"eighth not in the catalogue. Low is good: 0.69 is a half given to the truth.{size}"
    )


def _alt(score: TrialScore) -> str:
    told = [
        f"{richness} {value(each)}"
        + (f" (prototype {bound:g})" if math.isfinite(bound := _prototype(score, richness)) else "")
        for richness, each in of_richness(score, "log score")
    ]
    return f"Log score by richness of data: {'; '.join(told)}."


FIGURE = Member("trial_log_score", "How much is given to the truth", _draw, _caption, _alt)
