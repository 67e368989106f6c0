"""Draw end stiffness over time, of each plane or, where frequencies tell them apart, each end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.models import end_stiffness
from shm.report import formatting
from shm.report.contents import HangerReport
from shm.report.figures import specification as spec
from shm.report.figures import time_axes
from shm.report.formatting import Interval
from shm.report.sizes import size_of
from shm.watch.engine.state import Band as Bounds

_UNIT = "N m/rad"  # of what `shm.models.end_stiffness` returns
_PANEL_INCHES = 1.5  # layout


@dataclass(frozen=True, eq=False)
class _History:
    """The log10 of one stiffness in `unit`, by each test alone and as a state from all up to it.

    `state` is None where nothing is watched, `baseline` NaN where there is none.
    """

    title: str
    times: Sequence[datetime]
    tests: Sequence[str]
    alone: Bounds
    baseline: float
    state: Bounds | None = None
    unit: str = _UNIT

    @property
    def shown(self) -> Bounds:
        return self.alone if self.state is None else self.state


def _histories(data: HangerReport) -> list[_History]:
    """Return what the watch compares of the ends; each test alone where it compares nothing."""
    states, rows = data.states.within(data.period), data.dated_trend
    named = {row.time: row.row.test for row in rows}
    tests = [named.get(time, "test") for time in states.times]
    watched = [
        _History(q.title, states.times, tests, q.read, q.baseline, q.filtered, q.unit)
        for q in states.quantities
        if not q.is_tension
    ]
    if watched:
        return watched
    base = end_stiffness(data.baseline, data.hanger) if data.baseline else {}
    return [
        _History(
            formatting.quantity(name),
            [row.time for row in rows],
            [row.row.test for row in rows],
            time_axes.bounds_of([row.row.stiffness.get(name) for row in rows]),
            float(base[name].mean()) if name in base else math.nan,
        )
        for name in sorted({name for row in rows for name in row.row.stiffness}, reverse=True)
    ]


def _specify(data: HangerReport) -> spec.Specification | None:
    """Return panels one below the other, over one axis of time."""
    panels = [_panel(each, _reach(data)) for each in _histories(data)]
    if not panels:
        return None
    panels[:-1] = [replace(each, x=None) for each in panels[:-1]]
    return spec.stacked(panels, _PANEL_INCHES * len(panels) + 0.8)


def _reach(data: HangerReport) -> float:
    return data.hanger.thresholds.stiffness_shift_decades


def _in_millions(decades: Bounds) -> Bounds:
    """Return stiffnesses in millions of their unit from their log10."""
    return Bounds(*(10.0 ** (each - 6) for each in (decades.low, decades.middle, decades.high)))


def _panel(history: _History, reach: float) -> spec.Panel:
    alone = history.alone
    chosen = time_axes.places(alone.middle, alone.low, alone.high)
    when = [history.times[place] for place in chosen]
    names = [history.tests[place] for place in chosen]
    name, colour = ("", "purple") if history.state is None else ("state, 90 % band", "quiet")
    band = _in_millions(time_axes.part(history.shown, chosen))
    marks = [
        *time_axes.band(when, band, "purple", name),
        time_axes.single_tests(when, _in_millions(time_axes.part(alone, chosen)), names, colour),
    ]
    levels = ((0.0, "baseline", "green"), (reach, "threshold", "red"), (-reach, "threshold", "red"))
    for shift, level, hue in levels if math.isfinite(history.baseline) else ():
        at = 10.0 ** (history.baseline + shift - 6)
        marks.append(time_axes.level(at, level, hue, "dashdot" if shift else "dash"))
    # The baseline with its thresholds, and what is near them of tests and state.
    seen = [
        *(time_axes.inner(each) for each in (history.shown.low, history.shown.high, alone.middle)),
        history.baseline + np.array([-reach, reach]),
    ]
    low, high = (10.0 ** (end - 6) for end in spec.limits(*seen))
    return spec.Panel(
        y=spec.log_axis(f"M{history.unit}" if history.unit else "millions", low, high), marks=marks,
        x=time_axes.time_axis(history.times), title=history.title, title_side="left",
    )  # fmt: skip


def _caption(data: HangerReport) -> str:
    histories = _histories(data)
    what = (
        "Stiffness of the ends in MN m/rad (MN/m per node for a solid class), by each test "
        "and as a state from all tests up to each, with 90 % intervals; the ends stand apart where "
        "the frequencies tell them apart."
        if any(each.state for each in histories)
        else "Rotational stiffness of the ends by each test in MN m/rad, "
        "2/(1/k_deck + 1/k_arch) in each plane, because frequencies alone cannot tell the ends "
        "apart: mean and 90 % credible band."
    )
    levels = (
        f" Dashed: baseline; dash-dotted: thresholds, {10 ** _reach(data):.2g} times as much or as "
        "little."
        if any(math.isfinite(each.baseline) for each in histories)
        else ""
    )
    fewer = time_axes.thinned_words(max((len(each.times) for each in histories), default=0))
    return (
        f"{what}{levels} A wide band means that the measured modes hardly feel the stiffness."
        f"{fewer}"
    )


def _alt(data: HangerReport) -> str:
    return f"End stiffness over time; at last: {'; '.join(map(_last, _histories(data)))}."


def _last(history: _History) -> str:
    bounds = history.shown
    low, middle, high = (float(each[-1]) for each in (bounds.low, bounds.middle, bounds.high))
    if math.isnan(middle):
        return f"{history.title} not known"
    return f"{history.title} {size_of('log10_k', history.unit, Interval(middle, low, high))}"


FIGURE = spec.FigureSpec[HangerReport](
    "stiffness", "End stiffness over time", _specify, _caption, _alt
)
