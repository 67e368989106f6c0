"""How large a gap must be to be seen, by richness of data."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import colours
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial.figures.points import points
from shm.report.trial_scores import RICHNESS, find, large, value
from shm.values import Bin, Richness, TrialScore

_TICKS = (1, 4, 16, 64, 256, 1024)


def _draw(score: TrialScore) -> Figure | None:
    shown = [richness for richness in RICHNESS if _bins(score, richness)]
    if not shown:
        return None
    rows = -(-len(shown) // 3)
    figure = style.new_figure(2.1 * rows + 0.3)
    panels = figure.subplots(rows, 3, sharex=True, sharey=True, squeeze=False)
    for axes, richness in zip(panels.flat, shown, strict=False):
        _panel(axes, score, richness)
    for axes in panels.flat[len(shown) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel("share seen", fontsize=9, color=colours.INK)
    for axes in panels[-1]:
        axes.set_xlabel("size (standard deviations)", fontsize=9, color=colours.INK)
    return figure


def _bins(score: TrialScore, richness: Richness) -> list[Bin]:
    return [each for each in score.detection if each.richness == richness]


def _panel(axes: Axes, score: TrialScore, richness: Richness) -> None:
    style.dress(axes, "", "")
    axes.set_title(richness, fontsize=9, color=colours.INK, loc="left")
    bins = _bins(score, richness)
    points(axes, [each.mean for each in bins], [each.score for each in bins], colours.BLUE)
    mark = find(score, "detected")
    if mark and np.isfinite(mark.lower):
        axes.plot(
            [mark.above, _TICKS[-1]], [mark.lower] * 2, color=colours.ORANGE, linestyle="--",
            linewidth=1.2,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.minorticks_off()
    axes.set_xticks(_TICKS, [str(tick) for tick in _TICKS])
    axes.set_xlim(0.9, 1200)
    axes.set_ylim(-0.05, 1.08)


def _caption(score: TrialScore) -> str:
    return (
        "Share of planted causes at which anything but no gap leads, in bins of the planted size: "
        "the square root of the best chi-square difference that these data could show. Bars: 90 % "
        f"intervals. Dashed: what is asked above size {large(score):g}."
    )


def _alt(score: TrialScore) -> str:
    told = [
        f"size above {each.low:g}: {value(each.score)} of {each.score.cases}"
        for each in score.detection
        if not each.richness
    ]
    return f"Share of planted causes seen by size, each up to the next: {'; '.join(told)}."


FIGURE = Member("trial_detection", "How large a gap must be to be seen", _draw, _caption, _alt)
