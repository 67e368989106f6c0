"""What a blind trial planted and what was said: seen by size, called by name, left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shm.report import formatting
from shm.report.figures import style
from shm.report.figures.specification import Member
from shm.report.trial_scores import RICHNESS, find, judged, large, value
from shm.values import Bin, CaseScore, MarkName, Richness, Score, TrialScore
from shm.values.diagnosis import parted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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


# Layout: powers of four; letters turn white on what is darker.
_TICKS = (1, 4, 16, 64, 256, 1024)


def _draw_detection(score: TrialScore) -> Figure | None:
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
        axes.set_ylabel("share seen", fontsize=9, color=style.INK)
    for axes in panels[-1]:
        axes.set_xlabel("size (standard deviations)", fontsize=9, color=style.INK)
    return figure


def _bins(score: TrialScore, richness: Richness) -> list[Bin]:
    return [each for each in score.detection if each.richness == richness]


def _panel(axes: Axes, score: TrialScore, richness: Richness) -> None:
    style.dress(axes, "", "")
    axes.set_title(richness, fontsize=9, color=style.INK, loc="left")
    bins = _bins(score, richness)
    points(axes, [each.mean for each in bins], [each.score for each in bins], style.BLUE)
    mark = find(score, "detected")
    if mark and np.isfinite(mark.lower):
        axes.plot(
            [mark.above, _TICKS[-1]], [mark.lower] * 2, color=style.ORANGE, linestyle="--",
            linewidth=1.2,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.minorticks_off()
    axes.set_xticks(_TICKS, [str(tick) for tick in _TICKS])
    axes.set_xlim(0.9, 1200)
    axes.set_ylim(-0.05, 1.08)


def _caption_of_detection(score: TrialScore) -> str:
    return (
        "Share of planted causes at which anything but no gap leads, in bins of the planted size: "
        "the square root of the best chi-square difference that these data could show. Bars: 90 % "
        f"intervals. Dashed: what is asked above size {large(score):g}."
    )


def _alt_of_detection(score: TrialScore) -> str:
    told = [
        f"size above {each.low:g}: {value(each.score)} of {each.score.cases}"
        for each in score.detection
        if not each.richness
    ]
    return f"Share of planted causes seen by size, each up to the next: {'; '.join(told)}."


DETECTION = Member(
    "trial_detection",
    "How large a gap must be to be seen",
    _draw_detection,
    _caption_of_detection,
    _alt_of_detection,
)


_NOTHING, _TWO, _UNKNOWN = "nothing", "two effects", "not in the catalogue"
_NO_GAP, _PAIR, _UNEXPLAINED, _FAILED = "no gap", "a pair", "unexplained", "failed"
_DARK = 0.55  # layout: of the darkest; beyond, letters are white


def _row(case: CaseScore) -> str:
    return {"none": _NOTHING, "two": _TWO, "unknown": _UNKNOWN}.get(case.kind, case.planted)


def _column(case: CaseScore) -> str:
    if case.failure:
        return _FAILED
    return _PAIR if len(parted(case.leader)) > 1 else case.leader


def _confusion(score: TrialScore) -> tuple[list[str], list[str], Counter[tuple[str, str]]]:
    """Rows, columns and how often each met; an effect has the same place in both."""
    counts = Counter((_row(c), _column(c)) for c in judged(score, score.first_round))
    planted, said = ({pair[side] for pair in counts} for side in (0, 1))
    rest = {_NOTHING, _TWO, _UNKNOWN, _NO_GAP, _PAIR, _UNEXPLAINED, _FAILED}
    effects = sorted((planted | said) - rest)
    rows = [each for each in (_NOTHING, *effects, _TWO, _UNKNOWN) if each in planted]
    columns = [_NO_GAP, *(e for e in effects if e in said or e in planted), _PAIR, _UNEXPLAINED]
    return rows, columns + ([_FAILED] if _FAILED in said else []), counts


def _draw_confusion(score: TrialScore) -> Figure | None:
    # What draws is loaded where something is drawn.
    from matplotlib.colors import LinearSegmentedColormap

    rows, columns, counts = _confusion(score)
    if not rows:
        return None
    shades = LinearSegmentedColormap.from_list("share", ["#ffffff00", style.BLUE])
    table = np.array([[counts[row, column] for column in columns] for row in rows], dtype=float)
    share = table / table.sum(axis=1, keepdims=True)
    figure, axes = style.one_panel("said", "planted", 0.23 * len(rows) + 2.3)
    axes.grid(False)
    axes.imshow(share, cmap=shades, vmin=0, vmax=1, aspect="auto")
    for row, column in np.argwhere(table > 0):
        dark = share[row, column] > _DARK
        axes.text(
            column, row, f"{table[row, column]:.0f}", ha="center", va="center",
            fontsize=style.TINY, color="white" if dark else style.INK,
        )  # fmt: skip
    axes.set_xticks(range(len(columns)), list(map(formatting.quantity, columns)), rotation=60,
                    ha="right", rotation_mode="anchor")  # fmt: skip
    axes.set_yticks(range(len(rows)), list(map(formatting.quantity, rows)))
    axes.tick_params(length=0, labelsize=style.TINY)
    return figure


def _caption_of_confusion(score: TrialScore) -> str:
    return (
        "Rows: what was planted. Columns: what led, of causes that the data cannot tell apart the "
        "likeliest. Numbers are cases, shades shares of the row. Sound hangers, and sizes above "
        f"{large(score):g}."
    )


def _alt_of_confusion(score: TrialScore) -> str:
    _, _, counts = _confusion(score)
    told = [
        f"{formatting.quantity(planted)} called {formatting.quantity(said)} {number}"
        for (planted, said), number in sorted(counts.items())
    ]
    return f"Confusion matrix, cases: {'; '.join(told)}."


CONFUSION = Member(
    "trial_confusion",
    "What was planted and what was said",
    _draw_confusion,
    _caption_of_confusion,
    _alt_of_confusion,
)


_OUTCOMES = {
    "unexplained": style.GREEN,
    "one of its group": style.BLUE,
    "no gap": style.GRID,
    "another, not sure": style.PURPLE,
    "another, more than 0.9 sure": style.RED,
    "failed": style.INK,
}


def _outcome(case: CaseScore) -> str:
    if case.failure:
        return "failed"
    if case.leader in ("unexplained", "no gap"):
        return case.leader
    if case.in_group:
        return "one of its group"
    return "another, more than 0.9 sure" if case.misattributed else "another, not sure"


def _left_out(score: TrialScore) -> list[tuple[str, Counter[str]]]:
    own = [case for case in judged(score, score.left_out) if case.kind in ("one", "two")]
    found = [
        (richness, Counter(_outcome(case) for case in own if case.richness == richness))
        for richness in RICHNESS
    ]
    return [(name, counts) for name, counts in found if counts]


def _draw_left_out(score: TrialScore) -> Figure | None:
    rows = _left_out(score)
    if not rows:
        return None
    figure, axes = style.one_panel("share of the cases", "", 0.36 * len(rows) + 1.1)
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


def _caption_of_left_out(score: TrialScore) -> str:
    return (
        "What leads in the second round, in which the planted effects are taken out of the "
        "catalogue: unexplained is right; one that the first round could not tell from the true "
        "one is excusable; another with more than 0.9 must not be. In brackets the cases."
    )


def _alt_of_left_out(score: TrialScore) -> str:
    told = [
        f"{name}: {', '.join(f'{what} {number}' for what, number in counts.items())}"
        for name, counts in _left_out(score)
    ]
    return f"Answers without the true effect, {formatting.listed(told)}."


LEFT_OUT = Member(
    "trial_left_out",
    "With the true effect left out",
    _draw_left_out,
    _caption_of_left_out,
    _alt_of_left_out,
)
