"""Tension of every hanger over its nominal one, with its state."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import colours, formatting
from shm.report.contents import BridgeReport, HangerLine, Status
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.intervals import Interval

_MARKS = {
    Status.ALERT: (colours.RED, "v"),
    Status.WATCH: (colours.ORANGE, "D"),
    Status.STEADY: (colours.GREEN, "o"),
    Status.FIRST: (colours.BLUE, "s"),
}
_MOST_TICKS = 40
_VIEW_PERCENT = 25.0
"""How far beyond the means the figure reaches at most, so that a wide interval hides none."""


def _draw(data: BridgeReport) -> Figure | None:
    shares = _shares(data)
    if not shares:
        return None
    figure = style.new_figure(3.2)
    axes = figure.subplots()
    style.dress(axes, "hanger, in the order of the bridge", "tension (% of nominal)")
    axes.grid(False, axis="x")
    axes.axhline(100, color=colours.INK, linestyle=":", label="nominal")
    for status in Status:
        _points(axes, [each for each in shares if each[1].status is status], status)
    _view(axes, [share for *_, share in shares])
    _numbers(axes, data)
    style.legend_above(axes, columns=5)
    return figure


def _shares(data: BridgeReport) -> list[tuple[int, HangerLine, Interval]]:
    """Place, line and percent of nominal of the hangers that have a tension and a nominal one."""
    return [
        (place, line, share)
        for place, line in enumerate(data.hangers)
        if (share := line.of_nominal) is not None
    ]


def _points(axes: Axes, shares: list[tuple[int, HangerLine, Interval]], status: Status) -> None:
    if not shares:
        return
    colour, marker = _MARKS[status]
    places = [place for place, *_ in shares]
    means = np.array([share.mean for *_, share in shares])
    bounds = np.array([[share.low, share.high] for *_, share in shares]).T
    axes.vlines(places, *bounds, color=colour, linewidth=1.3)
    axes.plot(
        places, means, linestyle="none", marker=marker, markersize=5.5, color=colour,
        label=status.value.lower(),
    )  # fmt: skip


def _view(axes: Axes, shares: list[Interval]) -> None:
    means = [share.mean for share in shares] + [100.0]
    low = max(min(share.low for share in shares), min(means) - _VIEW_PERCENT)
    high = min(max(share.high for share in shares), max(means) + _VIEW_PERCENT)
    low, high = min(low, *means), max(high, *means)
    margin = 0.06 * (high - low) + 0.5
    axes.set_ylim(low - margin, high + margin)


def _numbers(axes: Axes, data: BridgeReport) -> None:
    step = 1 + (len(data.hangers) - 1) // _MOST_TICKS
    places = range(0, len(data.hangers), step)
    axes.set_xticks(list(places), [str(data.hangers[place].hanger.id) for place in places])
    axes.set_xlim(-0.8, len(data.hangers) - 0.2)


def _caption(data: BridgeReport) -> str:
    missing = len(data.hangers) - len(_shares(data))
    left_out = f" {formatting.counted(missing, 'hanger')} without a tension." if missing else ""
    return (
        "Tension of each hanger by its latest test, in percent of its nominal tension: mean and "
        "90 % interval, which may reach beyond the view; its state by mark and colour. Dotted: "
        f"nominal.{left_out}"
    )


def _alt(data: BridgeReport) -> str:
    told = [f"{line.hanger.id} {share.mean:.0f} %" for _, line, share in _shares(data)]
    return f"Tension over nominal of {formatting.counted(len(told), 'hanger')}: {', '.join(told)}."


FIGURE = Member("bridge_tension", "Tension of the hangers", _draw, _caption, _alt)
