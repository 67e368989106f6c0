"""What is said when the true effect is not in the catalogue."""

from __future__ import annotations

from collections import Counter

from matplotlib.figure import Figure

from shm.report import colours, formatting
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial_scores import RICHNESS, judged
from shm.values import CaseScore, TrialScore

_OUTCOMES = {
    "unexplained": colours.GREEN,
    "one of its group": colours.BLUE,
    "no gap": colours.GRID,
    "another, not sure": colours.PURPLE,
    "another, more than 0.9 sure": colours.RED,
    "failed": colours.INK,
}


def _outcome(case: CaseScore) -> str:
    if case.failure:
        return "failed"
    if case.leader in ("unexplained", "no gap"):
        return case.leader
    if case.in_group:
        return "one of its group"
    return "another, more than 0.9 sure" if case.misattributed else "another, not sure"


def _counts(score: TrialScore) -> list[tuple[str, Counter[str]]]:
    own = [case for case in judged(score, score.left_out) if case.kind in ("one", "two")]
    found = [
        (richness, Counter(_outcome(case) for case in own if case.richness == richness))
        for richness in RICHNESS
    ]
    return [(name, counts) for name, counts in found if counts]


def _draw(score: TrialScore) -> Figure | None:
    rows = _counts(score)
    if not rows:
        return None
    figure = style.new_figure(0.36 * len(rows) + 1.1)
    axes = figure.subplots()
    style.dress(axes, "share of the cases", "")
    done = [0.0] * len(rows)
    for name, colour in _OUTCOMES.items():
        shares = [counts[name] / counts.total() for _, counts in rows]
        if any(shares):
            axes.barh(range(len(rows)), shares, left=done, height=0.62, color=colour, label=name)
        done = [a + b for a, b in zip(done, shares, strict=True)]
    axes.set_yticks(range(len(rows)), [f"{name} ({counts.total()})" for name, counts in rows])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.grid(False, axis="y")
    style.legend_of_figure(figure, [axes], columns=3)
    return figure


def _caption(score: TrialScore) -> str:
    return (
        "What leads in the second round, in which the planted effects are taken out of the "
        "catalogue: unexplained is right; one that the first round could not tell from the true "
        "one is excusable; another with more than 0.9 must not be. In brackets the cases."
    )


def _alt(score: TrialScore) -> str:
    told = [
        f"{name}: {', '.join(f'{what} {number}' for what, number in counts.items())}"
        for name, counts in _counts(score)
    ]
    return f"Answers without the true effect, {formatting.listed(told)}."


FIGURE = Member("trial_left_out", "With the true effect left out", _draw, _caption, _alt)
