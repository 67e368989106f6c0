"""Whether probabilities mean what they say."""

from __future__ import annotations

from matplotlib.figure import Figure

from shm.report import colours
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial.figures.points import points
from shm.report.trial_scores import find, value
from shm.values import TrialScore


def _draw(score: TrialScore) -> Figure | None:
    bins = score.reliability
    if not bins:
        return None
    figure = style.new_figure(3.6)
    axes = figure.subplots()
    style.dress(axes, "probability of what leads", "share that is right")
    axes.plot([0, 1], [0, 1], color=colours.QUIET, linewidth=1.0, linestyle=":", label="just right")
    points(
        axes, [each.mean for each in bins], [each.score for each in bins], colours.BLUE,
        "found, with 90 % interval",
    )  # fmt: skip
    for each in bins:
        axes.hlines(each.score.value, each.low, each.high, color=colours.BLUE, linewidth=0.8)
    axes.set_xlim(min(0.4, bins[0].low - 0.02), 1.02)
    axes.set_ylim(-0.02, 1.05)
    style.legend_above(axes)
    return figure


def _caption(score: TrialScore) -> str:
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


def _alt(score: TrialScore) -> str:
    told = [
        f"probability {each.mean:.2f}: right in {value(each.score)} of {each.score.cases}"
        for each in score.reliability
    ]
    return f"Reliability of the leading probability: {'; '.join(told)}."


FIGURE = Member("trial_reliability", "Do the probabilities hold?", _draw, _caption, _alt)
