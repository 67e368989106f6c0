"""The error of the tension by the baseline and by the answer, case by case."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from shm.report import colours
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial_scores import find, judged, value
from shm.values import CaseScore, PlantedKind, TrialScore

_KINDS: dict[PlantedKind, tuple[str, str, str]] = {
    "none": ("nothing", colours.QUIET, "x"),
    "one": ("one effect", colours.BLUE, "o"),
    "two": ("two effects", colours.PURPLE, "s"),
    "unknown": ("not in the catalogue", colours.ORANGE, "^"),
}
_LEAST = 0.01


def _errors(case: CaseScore) -> tuple[float, float]:
    """In percent, what is too small to draw at the edge."""
    before, after = case.tension_error_before, case.tension_error_after
    return max(100 * abs(before), _LEAST), max(100 * abs(after), _LEAST)


def _shown(score: TrialScore) -> list[CaseScore]:
    return [
        case
        for case in judged(score, score.first_round)
        if math.isfinite(case.tension_error_before + case.tension_error_after)
    ]


def _draw(score: TrialScore) -> Figure | None:
    cases = _shown(score)
    if not cases:
        return None
    figure = style.new_figure(4.2)
    axes = figure.subplots()
    style.dress(axes, "error of the tension before (%)", "after (%)")
    for kind, (name, colour, marker) in _KINDS.items():
        own = np.array([_errors(case) for case in cases if case.kind == kind])
        if len(own):
            axes.plot(
                own[:, 0], own[:, 1], linestyle="none", marker=marker, markersize=4, color=colour,
                markerfacecolor="none", label=name,
            )  # fmt: skip
    ends = np.array([_LEAST * 0.8, 1.3 * max(max(_errors(case)) for case in cases)])
    axes.plot(ends, ends, color=colours.INK, linewidth=0.9, linestyle=":")
    axes.plot(ends, ends / 5, color=colours.GREEN, linewidth=1.1, linestyle="--")
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    ticks = [tick for tick in (0.01, 0.1, 1, 10, 100) if tick < ends[1]]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    style.legend_above(axes)
    return figure


def _caption(score: TrialScore) -> str:
    before, after = _medians(score)
    return (
        "Each case once: the error of the mean tension by the baseline alone and by the answer. "
        "Dotted: as large after as before; dashed: a fifth. Medians of the known effects: "
        f"{before} % before, {after} % after."
    )


def _medians(score: TrialScore) -> tuple[str, str]:
    before, after = find(score, "tension error before, %"), find(score, "tension error after, %")
    return (value(before.score) if before else "", value(after.score) if after else "")


def _alt(score: TrialScore) -> str:
    before, after = _medians(score)
    better = sum(_errors(case)[1] < _errors(case)[0] for case in _shown(score))
    return (
        f"Error of the tension before against after: smaller after in {better} of "
        f"{len(_shown(score))} cases; medians {before} % and {after} %."
    )


FIGURE = Member("trial_tension", "The tension before and after", _draw, _caption, _alt)
