"""Whether the gap shrinks where it was not fitted."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from shm.report import colours
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial_scores import find, value
from shm.values import TrialScore, Way

_COLOURS: dict[Way, str] = {"modes": colours.BLUE, "recordings": colours.ORANGE}


def _above(score: TrialScore) -> float:
    mark = find(score, "held-out misfit after over before")
    return mark.above if mark else 0.0


def _ratios(score: TrialScore, way: Way) -> list[float]:
    return sorted(
        case.held_out_ratio
        for case in score.first_round
        if case.way == way
        and case.kind in ("one", "two")
        and case.size > _above(score)
        and math.isfinite(case.held_out_ratio)
    )


def _draw(score: TrialScore) -> Figure | None:
    found = {way: ratios for way in _COLOURS if (ratios := _ratios(score, way))}
    if not found:
        return None
    figure = style.new_figure(2.9)
    axes = figure.subplots()
    style.dress(axes, "held-out error, after over before", "share of cases below")
    for way, ratios in found.items():
        axes.ecdf(ratios, color=_COLOURS[way], linewidth=1.5, label=f"{way} ({len(ratios)} cases)")
    axes.axvline(1.0, color=colours.QUIET, linestyle=":", linewidth=1.0)
    mark = find(score, "held-out misfit after over before")
    if mark and math.isfinite(mark.upper):
        axes.plot(
            mark.upper, 0.5, marker="D", markersize=6, color=colours.GREEN, linestyle="none",
            label="asked of the median: left of this",
        )  # fmt: skip
    axes.set_xlim(0, max(1.3, min(2.5, max(map(max, found.values())) * 1.05)))
    axes.set_ylim(0, 1.02)
    style.legend_above(axes)
    return figure


def _caption(score: TrialScore) -> str:
    return (
        "Frequencies are held out of the fit in turn, predicted by the baseline and by the leading "
        "cause, and compared with the true ones: the ratio of the errors (rms). 1: nothing gained, "
        f"also where no cause was claimed. One or two effects, size above {_above(score):g}; left "
        "out where the baseline already predicts better than was measured."
    )


def _alt(score: TrialScore) -> str:
    middle, worse = (
        find(score, name) for name in ("held-out misfit after over before", "held-out misfit worse")
    )
    told = [value(mark.score) if mark else "not known" for mark in (middle, worse)]
    return f"Ratio of held-out errors: median {told[0]}; share worse than before {told[1]}."


FIGURE = Member("trial_held_out", "Does the gap shrink where unseen?", _draw, _caption, _alt)
