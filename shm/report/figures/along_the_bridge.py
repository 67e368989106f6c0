"""Along the bridge: who gained and who lost tension, and what each hanger carries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.report import formatting
from shm.report.contents import BridgeReport
from shm.report.figures.specification import (
    Axis,
    Bars,
    FigureSpec,
    Illustration,
    Mark,
    Panel,
    Points,
    Rule,
    Specification,
    Symbol,
    drawn,
    stacked,
)
from shm.report.formatting import Interval
from shm.report.hanger_status import Status
from shm.report.hanger_summary import HangerSummary
from shm.report.shifts import shift_unit
from shm.watch.neighbours import BridgePattern

_WAYS = {"lost": "orange", "gained": "blue", "unchanged": "quiet"}
_MOST_NUMBERS = 24
_BAR_WIDTH = 0.62
_INCHES = 3.2


def bridge_illustration(pattern: BridgePattern) -> Illustration:
    """Return the picture of a pattern, with its caption and its words for the blind."""
    (illustration,) = drawn((SHIFTS,), pattern)
    return illustration


def specify_shifts(pattern: BridgePattern) -> Specification:
    """Return bars of the shifts with their intervals; hangers not compared as crosses at 0."""
    unit, _ = shift_unit(pattern)
    places = _places(pattern)
    marks: list[Mark] = []
    for way, colour in _WAYS.items():
        rows = [row for row in pattern.rows if row.way == way]
        if rows:
            marks.append(
                Bars(
                    x=[places[row.hanger] for row in rows],
                    y=unit.of(np.array([row.shift_n for row in rows])),
                    width=_BAR_WIDTH,
                    colour=colour,
                    name=way,
                )
            )
    marks.append(
        Points(
            x=[places[row.hanger] for row in pattern.rows],
            y=unit.of(np.array([row.shift_n for row in pattern.rows])),
            low=unit.of(np.array([row.low_n for row in pattern.rows])),
            high=unit.of(np.array([row.high_n for row in pattern.rows])),
            symbol="tick",
            size=3,
            name="90 % interval",
            texts=[f"hanger {row.hanger}" for row in pattern.rows],
        )
    )
    if pattern.not_compared:
        at = [places[each.hanger] for each in pattern.not_compared]
        marks.append(
            Points(
                x=at, y=[0.0] * len(at), symbol="thin cross", colour="quiet", name="not compared"
            )
        )
    marks.append(Rule(at=0.0))
    return stacked(
        [
            Panel(
                y=Axis(label=f"lost or gained ({unit.name})"),
                marks=marks,
                x=_along(places),
            )
        ],
        _INCHES,
        5,
    )


def _places(pattern: BridgePattern) -> dict[int, int]:
    """Return the place of each hanger in the order of the bridge."""
    places = {each.hanger: each.place for each in pattern.rows}
    return places | {each.hanger: each.place for each in pattern.not_compared}


def _along(places: dict[int, int]) -> Axis:
    ordered = sorted(places, key=lambda hanger: places[hanger])
    shown = ordered[:: 1 + (len(ordered) - 1) // _MOST_NUMBERS]
    return Axis(
        label="hanger, in the order of the bridge",
        range=(min(places.values()) - 1, max(places.values()) + 1),
        ticks=[places[hanger] for hanger in shown],
        tick_labels=[str(hanger) for hanger in shown],
        grid=False,
    )


def _caption_of_shifts(pattern: BridgePattern) -> str:
    unit, _ = shift_unit(pattern)
    crosses = " Crosses: not compared, no recent test." if pattern.not_compared else ""
    return (
        f"Change of the tension of each hanger since its baseline in {unit.name}, with 90 % "
        f"intervals; its colour says whether it has more probably changed than not.{crosses} "
        f"{pattern.sentence}"
    )


def _alt_of_shifts(pattern: BridgePattern) -> str:
    unit, places = shift_unit(pattern)
    moved = [
        f"hanger {row.hanger} {unit.of(row.shift_n):+z.{places - 1}f} {unit.name} "
        f"({100 * row.shift_fraction:+z.1f} %)"
        for row in pattern.rows
        if row.way != "unchanged"
    ]
    which = formatting.listed(moved) if moved else "none moved"
    return f"Shifts of the tension of {len(pattern.rows)} hangers along the bridge: {which}."


SHIFTS = FigureSpec(
    "bridge_shift", "Shifts along the bridge", specify_shifts, _caption_of_shifts, _alt_of_shifts
)


_MARKS: dict[Status, tuple[str, Symbol]] = {
    Status.ALERT: ("red", "triangle down"),
    Status.WATCH: ("orange", "diamond"),
    Status.CHECK: ("orange", "cross"),
    Status.UNCLEAR: ("orange", "square"),
    Status.STEADY: ("green", "circle"),
    Status.FIRST: ("blue", "circle"),
}
_MOST_TICKS = 40
_VIEW_PERCENT = 25.0
"""How far beyond the means the figure reaches at most, so that a wide interval hides none."""


def specify_tensions(data: BridgeReport) -> Specification | None:
    """Return the tension of each hanger over its nominal one; None where none is determined."""
    shares = _shares(data)
    if not shares:
        return None
    marks = [
        Points(
            x=[place for place, line, _ in shares if line.status is status],
            y=[share.mean for _, line, share in shares if line.status is status],
            low=[share.low for _, line, share in shares if line.status is status],
            high=[share.high for _, line, share in shares if line.status is status],
            colour=colour,
            symbol=symbol,
            size=5.5,
            caps=False,
            name=status.value.lower(),
            texts=[f"hanger {line.hanger.id}" for _, line, _ in shares if line.status is status],
        )
        for status, (colour, symbol) in _MARKS.items()
        if any(line.status is status for _, line, _ in shares)
    ]
    step = 1 + (len(data.hangers) - 1) // _MOST_TICKS
    places = range(0, len(data.hangers), step)
    across = Axis(
        label="hanger, in the order of the bridge",
        range=(-0.8, len(data.hangers) - 0.2),
        ticks=list(places),
        tick_labels=[str(data.hangers[place].hanger.id) for place in places],
        grid=False,
    )
    upright = Axis(label="tension (% of nominal)", range=_view([share for *_, share in shares]))
    nominal = Rule(at=100.0, name="nominal", dash="dot")
    return stacked([Panel(y=upright, marks=[nominal, *marks], x=across)], _INCHES, 5)


def _shares(data: BridgeReport) -> list[tuple[int, HangerSummary, Interval]]:
    """Return place, hanger and percent of nominal where the tension is determined."""
    return [
        (place, line, share)
        for place, line in enumerate(data.hangers)
        if line.is_determined and (share := line.of_nominal) is not None
    ]


def _view(shares: Sequence[Interval]) -> tuple[float, float]:
    means = [share.mean for share in shares] + [100.0]
    low = max(min(share.low for share in shares), min(means) - _VIEW_PERCENT)
    high = min(max(share.high for share in shares), max(means) + _VIEW_PERCENT)
    low, high = min(low, *means), max(high, *means)
    margin = 0.06 * (high - low) + 0.5
    return low - margin, high + margin


def _caption_of_tensions(data: BridgeReport) -> str:
    wide = [str(each.hanger.id) for each in data.hangers if each.latest and not each.is_determined]
    missing = len(data.hangers) - len(_shares(data)) - len(wide)
    left_out = f" {formatting.counted(missing, 'hanger')} without a tension." if missing else ""
    if wide:
        left_out += f" Modes that do not determine it, not drawn: {formatting.listed(wide)}."
    return (
        "Tension of each hanger since its last change, in percent of its nominal tension: mean and "
        "90 % interval, which may reach beyond the view; its state by mark and colour. Dotted: "
        f"nominal.{left_out}"
    )


def _alt_of_tensions(data: BridgeReport) -> str:
    each = [f"{line.hanger.id} {share.mean:.0f} %" for _, line, share in _shares(data)]
    return f"Tension over nominal of {formatting.counted(len(each), 'hanger')}: {', '.join(each)}."


TENSIONS = FigureSpec(
    "bridge_tension",
    "Tension of the hangers",
    specify_tensions,
    _caption_of_tensions,
    _alt_of_tensions,
)
