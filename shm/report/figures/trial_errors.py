"""How far a blind trial was off: probabilities, tensions, intervals, held-out frequencies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from shm.report.figures import style
from shm.report.figures.specification import Member
from shm.report.figures.trial_answers import name_richness, of_richness, points
from shm.report.trial_scores import find, judged, value
from shm.values import CaseScore, MarkName, PlantedKind, Richness, TrialScore, Way

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _draw_reliability(score: TrialScore) -> Figure | None:
    bins = score.reliability
    if not bins:
        return None
    figure, axes = style.one_panel("probability of what leads", "share that is right", 3.6)
    axes.plot([0, 1], [0, 1], color=style.QUIET, linewidth=1.0, linestyle=":", label="just right")
    points(
        axes, [each.mean for each in bins], [each.score for each in bins], style.BLUE,
        "found, with 90 % interval",
    )  # fmt: skip
    for each in bins:
        axes.hlines(each.score.value, each.low, each.high, color=style.BLUE, linewidth=0.8)
    axes.set_xlim(min(0.4, bins[0].low - 0.02), 1.02)
    axes.set_ylim(-0.02, 1.05)
    style.legend_above(axes)
    return figure


def _caption_of_reliability(score: TrialScore) -> str:
    cases = score.reliability[0].score.cases
    error, counted, chance = (
        find(score, name)
        for name in (
            "calibration error", "calibration error as counted", "calibration error by chance"
        )
    )  # fmt: skip
    told = (
        f" Expected calibration error {value(error.score)}; as counted {value(counted.score)}, of "
        f"which chance alone gives {value(chance.score)} with so many cases."
        if error and counted and chance
        else ""
    )
    return (
        "The probability of the leading claim (of a group the sum) against how often it was right, "
        f"in bins of about {cases} cases of every size; lines along the bins.{told}"
    )


def _alt_of_reliability(score: TrialScore) -> str:
    told = [
        f"probability {each.mean:.2f}: right in {value(each.score)} of {each.score.cases}"
        for each in score.reliability
    ]
    return f"Reliability of the leading probability: {'; '.join(told)}."


RELIABILITY = Member(
    "trial_reliability",
    "Do the probabilities hold?",
    _draw_reliability,
    _caption_of_reliability,
    _alt_of_reliability,
)


def _prototype(score: TrialScore, richness: Richness) -> float:
    mark = find(score, "log score", richness=richness)
    return mark.upper if mark else math.inf


def _draw_log_score(score: TrialScore) -> Figure | None:
    found = of_richness(score, "log score")
    if not found:
        return None
    figure, axes = style.one_panel("", "log score", 2.8)
    points(axes, range(len(found)), [each for _, each in found], style.BLUE, "this trial")
    before = [_prototype(score, richness) for richness, _ in found]
    there = [(x, bound) for x, bound in enumerate(before) if math.isfinite(bound)]
    if there:
        axes.plot(
            *zip(*there, strict=True), linestyle="none", marker="D", markersize=5,
            color=style.ORANGE, label="prototype: the mark to beat",
        )  # fmt: skip
    name_richness(axes, [richness for richness, _ in found])
    axes.set_ylim(bottom=0)
    style.legend_above(axes)
    return figure


def _caption_of_log_score(score: TrialScore) -> str:
    mark = find(score, "log score")
    size = f" Sizes above {mark.above:g}, and sound hangers." if mark and mark.above else ""
    return (
        "Mean of -ln of the probability that was given to the truth (no gap, the effect, the pair, "
        "unexplained), weighed to the mix of a quarter nothing, a half one, an eighth two and an "
        f"eighth not in the catalogue. Low is good: 0.69 is a half given to the truth.{size}"
    )


def _alt_of_log_score(score: TrialScore) -> str:
    told = [
        f"{richness} {value(each)}"
        + (f" (prototype {bound:g})" if math.isfinite(bound := _prototype(score, richness)) else "")
        for richness, each in of_richness(score, "log score")
    ]
    return f"Log score by richness of data: {'; '.join(told)}."


LOG_SCORE = Member(
    "trial_log_score",
    "How much is given to the truth",
    _draw_log_score,
    _caption_of_log_score,
    _alt_of_log_score,
)


_KINDS: dict[PlantedKind, tuple[str, str, str]] = {
    "none": ("nothing", style.QUIET, "x"),
    "one": ("one effect", style.BLUE, "o"),
    "two": ("two effects", style.PURPLE, "s"),
    "unknown": ("not in the catalogue", style.ORANGE, "^"),
}
_LEAST = 0.01  # layout: of a per cent, where an axis of logarithms begins


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


def _draw_tension_errors(score: TrialScore) -> Figure | None:
    cases = _shown(score)
    if not cases:
        return None
    figure, axes = style.one_panel("error of the tension before (%)", "after (%)", 4.2)
    for kind, (name, colour, marker) in _KINDS.items():
        own = np.array([_errors(case) for case in cases if case.kind == kind])
        if len(own):
            axes.plot(
                own[:, 0], own[:, 1], linestyle="none", marker=marker, markersize=4, color=colour,
                markerfacecolor="none", label=name,
            )  # fmt: skip
    ends = np.array([_LEAST * 0.8, 1.3 * max(max(_errors(case)) for case in cases)])
    axes.plot(ends, ends, color=style.INK, linewidth=0.9, linestyle=":")
    axes.plot(ends, ends / 5, color=style.GREEN, linewidth=1.1, linestyle="--")
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    ticks = [tick for tick in (0.01, 0.1, 1, 10, 100) if tick < ends[1]]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    style.legend_above(axes)
    return figure


def _caption_of_tension_errors(score: TrialScore) -> str:
    before, after = _medians(score)
    return (
        "Each case once: the error of the mean tension by the baseline alone and by the answer. "
        "Dotted: as large after as before; dashed: a fifth. Medians of the known effects: "
        f"{before} % before, {after} % after."
    )


def _medians(score: TrialScore) -> tuple[str, str]:
    before, after = find(score, "tension error before, %"), find(score, "tension error after, %")
    return (value(before.score) if before else "", value(after.score) if after else "")


def _alt_of_tension_errors(score: TrialScore) -> str:
    before, after = _medians(score)
    better = sum(_errors(case)[1] < _errors(case)[0] for case in _shown(score))
    return (
        f"Error of the tension before against after: smaller after in {better} of "
        f"{len(_shown(score))} cases; medians {before} % and {after} %."
    )


TENSION_ERRORS = Member(
    "trial_tension",
    "The tension before and after",
    _draw_tension_errors,
    _caption_of_tension_errors,
    _alt_of_tension_errors,
)


# Layout: marks, their words, and where each axis ends.
_PANELS: tuple[tuple[MarkName, str, float], ...] = (
    ("tension covered", "tension, 95 % interval", 0.95),
    ("size covered", "effect's size, 90 % interval", 0.90),
)


def _draw_coverage(score: TrialScore) -> Figure | None:
    shown = [panel for panel in _PANELS if of_richness(score, panel[0])]
    if not shown:
        return None
    figure = style.new_figure(2.8)
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for axes, (name, title, nominal) in zip(panels, shown, strict=True):
        _panel(axes, score, name, nominal)
        axes.set_title(title, fontsize=9, color=style.INK, loc="left")
    panels[0].set_ylabel("share that holds the truth", fontsize=9, color=style.INK)
    return figure


def _panel(axes: Axes, score: TrialScore, name: MarkName, nominal: float) -> None:
    style.dress(axes, "", "")
    found = of_richness(score, name)
    mark = find(score, name)
    if mark and math.isfinite(mark.lower + mark.upper):
        axes.axhspan(mark.lower, mark.upper, color=style.GREEN, alpha=0.15, linewidth=0)
    axes.axhline(nominal, color=style.QUIET, linestyle=":", linewidth=1.0)
    points(axes, range(len(found)), [each for _, each in found], style.BLUE)
    name_richness(axes, [richness for richness, _ in found])
    lowest = min((each.low for _, each in found if math.isfinite(each.low)), default=0.5)
    axes.set_ylim(min(0.5, axes.get_ylim()[0], lowest - 0.05), 1.03)


def _caption_of_coverage(score: TrialScore) -> str:
    return (
        "Left: how often the 95 % interval of the tension holds the truth, over all cases. Right: "
        "how often the 90 % interval of a single effect's size does, where its place was found. "
        "Dotted: the nominal share; shaded: what is asked over all data. Bars: 90 % intervals."
    )


def _alt_of_coverage(score: TrialScore) -> str:
    told = []
    for name, title, _ in _PANELS:
        shares = [f"{richness} {value(each)}" for richness, each in of_richness(score, name)]
        told.append(f"{title}: {', '.join(shares) or 'not known'}")
    return f"Coverage by richness of data. {'; '.join(told)}."


COVERAGE = Member(
    "trial_coverage",
    "Do the intervals hold the truth?",
    _draw_coverage,
    _caption_of_coverage,
    _alt_of_coverage,
)


_COLOURS: dict[Way, str] = {"modes": style.BLUE, "recordings": style.ORANGE}


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


def _draw_held_out(score: TrialScore) -> Figure | None:
    found = {way: ratios for way in _COLOURS if (ratios := _ratios(score, way))}
    if not found:
        return None
    figure, axes = style.one_panel("held-out error, after over before", "share of cases below", 2.9)
    for way, ratios in found.items():
        axes.ecdf(ratios, color=_COLOURS[way], linewidth=1.5, label=f"{way} ({len(ratios)} cases)")
    axes.axvline(1.0, color=style.QUIET, linestyle=":", linewidth=1.0)
    mark = find(score, "held-out misfit after over before")
    if mark and math.isfinite(mark.upper):
        axes.plot(
            mark.upper, 0.5, marker="D", markersize=6, color=style.GREEN, linestyle="none",
            label="asked of the median: left of this",
        )  # fmt: skip
    axes.set_xlim(0, max(1.3, min(2.5, max(map(max, found.values())) * 1.05)))
    axes.set_ylim(0, 1.02)
    style.legend_above(axes)
    return figure


def _caption_of_held_out(score: TrialScore) -> str:
    return (
        "Frequencies are held out of the fit in turn, predicted by the baseline and by the leading "
        "cause, and compared with the true ones: the ratio of the errors (rms). 1: nothing gained, "
        f"also where no cause was claimed. One or two effects, size above {_above(score):g}; left "
        "out where the baseline already predicts better than was measured."
    )


def _alt_of_held_out(score: TrialScore) -> str:
    middle, worse = (
        find(score, name) for name in ("held-out misfit after over before", "held-out misfit worse")
    )
    told = [value(mark.score) if mark else "not known" for mark in (middle, worse)]
    return f"Ratio of held-out errors: median {told[0]}; share worse than before {told[1]}."


HELD_OUT = Member(
    "trial_held_out",
    "Does the gap shrink where unseen?",
    _draw_held_out,
    _caption_of_held_out,
    _alt_of_held_out,
)
