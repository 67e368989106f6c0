"""What was planted against what was said."""

from __future__ import annotations

from collections import Counter

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from shm.report import colours, formatting
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.trial_scores import judged, large
from shm.values import CaseScore, TrialScore
from shm.values.diagnosis import parted

_NOTHING, _TWO, _UNKNOWN = "nothing", "two effects", "not in the catalogue"
_NO_GAP, _PAIR, _UNEXPLAINED, _FAILED = "no gap", "a pair", "unexplained", "failed"
_SHADES = LinearSegmentedColormap.from_list("share", ["#ffffff00", colours.BLUE])
_DARK = 0.55


def _row(case: CaseScore) -> str:
    return {"none": _NOTHING, "two": _TWO, "unknown": _UNKNOWN}.get(case.kind, case.planted)


def _column(case: CaseScore) -> str:
    if case.failure:
        return _FAILED
    return _PAIR if len(parted(case.leader)) > 1 else case.leader


def _counts(score: TrialScore) -> tuple[list[str], list[str], Counter[tuple[str, str]]]:
    """Rows, columns and how often each met; an effect has the same place in both."""
    counts = Counter((_row(c), _column(c)) for c in judged(score, score.first_round))
    planted, said = ({pair[side] for pair in counts} for side in (0, 1))
    rest = {_NOTHING, _TWO, _UNKNOWN, _NO_GAP, _PAIR, _UNEXPLAINED, _FAILED}
    effects = sorted((planted | said) - rest)
    rows = [each for each in (_NOTHING, *effects, _TWO, _UNKNOWN) if each in planted]
    columns = [_NO_GAP, *(e for e in effects if e in said or e in planted), _PAIR, _UNEXPLAINED]
    return rows, columns + ([_FAILED] if _FAILED in said else []), counts


def _draw(score: TrialScore) -> Figure | None:
    rows, columns, counts = _counts(score)
    if not rows:
        return None
    table = np.array([[counts[row, column] for column in columns] for row in rows], dtype=float)
    share = table / table.sum(axis=1, keepdims=True)
    figure = style.new_figure(0.23 * len(rows) + 2.3)
    axes = figure.subplots()
    style.dress(axes, "said", "planted")
    axes.grid(False)
    axes.imshow(share, cmap=_SHADES, vmin=0, vmax=1, aspect="auto")
    for row, column in np.argwhere(table > 0):
        dark = share[row, column] > _DARK
        axes.text(
            column, row, f"{table[row, column]:.0f}", ha="center", va="center",
            fontsize=style.TINY, color="white" if dark else colours.INK,
        )  # fmt: skip
    axes.set_xticks(range(len(columns)), list(map(formatting.quantity, columns)), rotation=60,
                    ha="right", rotation_mode="anchor")  # fmt: skip
    axes.set_yticks(range(len(rows)), list(map(formatting.quantity, rows)))
    axes.tick_params(length=0, labelsize=style.TINY)
    return figure


def _caption(score: TrialScore) -> str:
    return (
        "Rows: what was planted. Columns: what led, of causes that the data cannot tell apart the "
        "likeliest. Numbers are cases, shades shares of the row. Sound hangers, and sizes above "
        f"{large(score):g}."
    )


def _alt(score: TrialScore) -> str:
    _, _, counts = _counts(score)
    told = [
        f"{formatting.quantity(planted)} called {formatting.quantity(said)} {number}"
        for (planted, said), number in sorted(counts.items())
    ]
    return f"Confusion matrix, cases: {'; '.join(told)}."


FIGURE = Member("trial_confusion", "What was planted and what was said", _draw, _caption, _alt)
