"""Scores with their intervals as points with bars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from shm.report.figures import style
from shm.report.trial_scores import RICHNESS, find
from shm.values import MarkName, Richness, Score, TrialScore


def points(
    axes: Axes, x: Sequence[float], scores: Sequence[Score], colour: str, label: str = ""
) -> None:
    """Scores at `x` with their 90 % intervals."""
    value = np.array([score.value for score in scores])
    low = np.array([score.low for score in scores])
    high = np.array([score.high for score in scores])
    axes.errorbar(
        x, value, yerr=np.nan_to_num([value - low, high - value]).clip(min=0.0), color=colour,
        marker="o", markersize=4.5, linestyle="none", linewidth=1.4, capsize=2.5, label=label,
    )  # fmt: skip


def of_richness(score: TrialScore, name: MarkName) -> list[tuple[Richness, Score]]:
    """The scores of that name that are known, by richness."""
    found = [(richness, find(score, name, richness=richness)) for richness in RICHNESS]
    return [(richness, mark.score) for richness, mark in found if mark and mark.score.cases]


def name_richness(axes: Axes, names: Sequence[str]) -> None:
    """Names below the points, aslant so that they fit half a page."""
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right", rotation_mode="anchor")
    axes.tick_params(axis="x", length=0, labelsize=style.TINY + 1)
    axes.grid(False, axis="x")
    axes.set_xlim(-0.6, len(names) - 0.4)
