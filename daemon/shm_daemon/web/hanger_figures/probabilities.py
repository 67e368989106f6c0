"""Probabilities as bars one below the other."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from shm.report import words
from shm.report.figures.specification import Axis, Bars, Panel, Specification, stacked

_WIDTH = 30
"""Of a name, in letters: a phone shows the bars too."""


def probability_bars(rows: Sequence[tuple[str, float, str]]) -> Specification:
    """Name, probability and colour of each, from the top."""
    bars = [
        Bars(
            x=[place], y=[share], lying=True, width=0.6, colour=colour,
            labels=[words.probability(share)], texts=[f"{name}: {words.probability(share)}"],
        )
        for place, (name, share, colour) in enumerate(rows)
    ]  # fmt: skip
    names = Axis(
        range=(len(rows) - 0.4, -0.6), ticks=range(len(rows)), grid=False,
        tick_labels=[textwrap.fill(name, _WIDTH) for name, _, _ in rows],
    )  # fmt: skip
    across = Axis(label="probability", range=(0, 1.15), ticks=(0, 0.2, 0.4, 0.6, 0.8, 1))
    return stacked([Panel(y=names, marks=bars, x=across)], 3.4)
