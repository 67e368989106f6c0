"""How probable each cause is, beside no gap and something that is not in the catalogue."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.diagnosis.content import Claim, DiagnosisSheet, claims
from shm.report.diagnosis.phrases import label
from shm.report.diagnosis.summary import verdict
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.values import Cause, Diagnosis

_MOST = 10
_ROW_INCHES, _TALL_ROW_INCHES = 0.3, 0.4
_LEAST_SHOWN = 0.0005
_LABEL = 40
_NOTE = style.TINY + 0.5
_BRACKET_TEXT = 0.42
"""Room for the words beside a bracket and the column of Bayes factors."""


@dataclass(frozen=True)
class _Bar:
    """One row of the figure; `claim` is the group that it belongs to, None for a lone one."""

    label: str
    probability: float
    colour: str
    beside: str = ""
    claim: Claim | None = None


def _draw(sheet: DiagnosisSheet) -> Figure | None:
    bars = _bars(sheet.diagnosis)
    if not any(bar.probability > 0 for bar in bars):
        return None
    labels = [textwrap.fill(bar.label, _LABEL) for bar in bars]
    is_tall = any(label.count("\n") > 1 for label in labels)
    figure = style.new_figure((_TALL_ROW_INCHES if is_tall else _ROW_INCHES) * len(bars) + 1.0)
    axes = figure.subplots()
    style.dress(axes, "probability", "")
    axes.barh(
        range(len(bars)),
        [bar.probability for bar in bars],
        height=0.62,
        color=[bar.colour for bar in bars],
        linewidth=0,
    )
    for row, bar in enumerate(bars):
        _write(axes, row, bar)
    right = _brackets(axes, bars)
    axes.set_yticks(range(len(bars)), labels)
    axes.tick_params(axis="y", length=0, labelsize=style.TINY + 1)
    axes.grid(False, axis="y")
    axes.set_ylim(len(bars) - 0.45, -1.2)
    axes.set_xlim(0, max(1.3, right + _BRACKET_TEXT))
    axes.set_xticks(np.arange(0, 1.01, 0.2))
    _beside(axes, -0.85, "log Bayes factor")
    return figure


def _bars(diagnosis: Diagnosis) -> list[_Bar]:
    shown = _shown(diagnosis)
    bars = [
        _Bar(
            label(cause),
            cause.probability,
            style.BLUE,
            words.number(cause.log_bayes_factor, "+z.1f"),
            claim if len(claim.causes) > 1 else None,
        )
        for claim, cause in shown
    ]
    rest = diagnosis.unexplained_probability
    bars.append(_Bar("something not in the catalogue", rest, style.ORANGE))
    bars.append(_Bar("no gap", diagnosis.no_gap_probability, style.GREEN))
    return bars


def _shown(diagnosis: Diagnosis) -> list[tuple[Claim, Cause]]:
    """Causes of any probability to speak of, at least three where there are so many."""
    all_causes = [(claim, cause) for claim in claims(diagnosis) for cause in claim.causes]
    probable = [pair for pair in all_causes if pair[1].probability >= _LEAST_SHOWN]
    return probable[:_MOST] if len(probable) >= 3 else all_causes[:3]


def _write(axes: Axes, row: int, bar: _Bar) -> None:
    """The probability behind the bar, the Bayes factor in a column on the right."""
    axes.annotate(
        words.probability(bar.probability),
        (max(bar.probability, 0.0), row),
        xytext=(5, 0),
        textcoords="offset points",
        va="center",
        fontsize=_NOTE,
        color=style.INK,
    )
    _beside(axes, row, bar.beside)


def _beside(axes: Axes, row: float, told: str) -> None:
    place = axes.get_yaxis_transform()
    axes.text(
        1.0, row, told, transform=place, va="center", ha="right", fontsize=_NOTE, color=style.QUIET
    )


def _brackets(axes: Axes, bars: list[_Bar]) -> float:
    """A bracket around causes that the data cannot tell apart, with what they have together.

    Gives the place of the outermost bracket.
    """
    outermost = 0.0
    found: dict[int, tuple[Claim, list[int]]] = {}
    for row, bar in enumerate(bars):
        if bar.claim is not None:
            found.setdefault(id(bar.claim), (bar.claim, []))[1].append(row)
    for claim, rows in found.values():
        x = max(bars[row].probability for row in rows) + 0.13
        top, bottom = rows[0] - 0.3, rows[-1] + 0.3
        axes.plot(
            [x - 0.012, x, x, x - 0.012],
            [top, top, bottom, bottom],
            color=style.PURPLE,
            linewidth=1.4,
        )
        axes.text(
            x + 0.015,
            (top + bottom) / 2,
            f"not told apart:\n{words.probability(claim.probability)} together",
            va="center",
            fontsize=_NOTE,
            color=style.PURPLE,
        )
        outermost = max(outermost, x)
    return outermost


def _caption(sheet: DiagnosisSheet) -> str:
    diagnosis = sheet.diagnosis
    left = len(diagnosis.causes) - len(_shown(diagnosis))
    more = f" {words.counted(left, 'less probable cause')} {_are(left)} not drawn." if left else ""
    groups = (
        " A bracket holds causes that these data cannot tell apart; what counts is their sum."
        if diagnosis.groups
        else ""
    )
    return (
        "Probability of each cause, of something that the catalogue does not hold, and of no gap; "
        f"all add to 1.{groups}{more}"
    )


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _alt(sheet: DiagnosisSheet) -> str:
    bars = [f"{bar.label} {words.probability(bar.probability)}" for bar in _bars(sheet.diagnosis)]
    return f"{verdict(sheet.diagnosis)} Probabilities: {'; '.join(bars)}."


FIGURE = Member("causes", "What causes the gap", _draw, _caption, _alt)
