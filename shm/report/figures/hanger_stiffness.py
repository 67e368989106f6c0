"""End stiffness over time, of each plane or, where frequencies tell the ends apart, of each end."""

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
from shm.values import FloatArray
from shm.watch.state import Band as Bounds

END_STIFFNESS_UNIT = "N m/rad"
"""The unit of what `shm.models.end_stiffness` returns."""
_PANEL_INCHES = 1.5  # layout


@dataclass(frozen=True, eq=False)
class StiffnessHistory:
    """One stiffness over time, as the log10 of it in `unit` (N/m a node for a solid class).

    `baseline` is NaN where there is none; `state` is what all tests up to each say together.
    """

    title: str
    times: Sequence[datetime]
    tests: Sequence[str]
    alone: Bounds
    baseline: float
    state: Bounds | None = None
    unit: str = END_STIFFNESS_UNIT


def _specify(
    courses: Sequence[StiffnessHistory], reach_decades: float
) -> spec.Specification | None:
    """Return panels one below the other, over one axis of time."""
    if not courses:
        return None
    panels = [_panel(course, reach_decades) for course in courses]
    panels[:-1] = [replace(each, x=None) for each in panels[:-1]]
    return spec.stacked(panels, _PANEL_INCHES * len(panels) + 0.8)


def _axis(label: str, low: float, high: float) -> spec.Axis:
    """Return a logarithmic axis; of more than two decades with a number at each of them."""
    if high < 200 * low:
        return spec.log_axis(label, low, high)
    ticks = [10.0**n for n in range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)]
    return replace(
        spec.log_axis(label, low, high), ticks=ticks, tick_labels=[f"{each:g}" for each in ticks]
    )


def _in_millions(decades: Bounds) -> Bounds:
    """Return stiffnesses in millions of their unit from their log10."""
    return Bounds(*(10.0 ** (each - 6) for each in (decades.low, decades.middle, decades.high)))


def _panel(course: StiffnessHistory, reach: float) -> spec.Panel:
    alone = course.alone
    chosen = time_axes.places(alone.middle, alone.low, alone.high)
    when = [course.times[place] for place in chosen.tolist()]
    shown = _in_millions(time_axes.part(alone, chosen))
    names = [course.tests[i] for i in chosen.tolist()]
    state = None if course.state is None else _in_millions(time_axes.part(course.state, chosen))
    marks: list[spec.Mark] = [
        *(
            time_axes.band(when, shown, "purple")
            if state is None
            else time_axes.band(when, state, "purple", "state, 90 % band")
        ),
        time_axes.single_tests(when, shown, names, "purple" if state is None else "quiet"),
    ]
    levels = ((0.0, "baseline", "green"), (reach, "threshold", "red"), (-reach, "threshold", "red"))
    if not math.isnan(course.baseline):
        marks += [
            time_axes.level(
                10.0 ** (course.baseline + shift - 6),
                name,
                hue,
                "dash" if shift == 0 else "dashdot",
            )
            for shift, name, hue in levels
        ]  # fmt: skip
    # The baseline with its thresholds, and what is near them of tests and state.
    bounds = course.alone if course.state is None else course.state
    seen: list[FloatArray] = [time_axes.inner(each) for each in (bounds.low, bounds.high)]
    seen += [time_axes.inner(alone.middle), course.baseline + np.array([-reach, reach])]
    low, high = (10.0 ** (end - 6) for end in spec.limits(*seen))
    return spec.Panel(
        y=_axis(f"M{course.unit}" if course.unit else "millions", low, high), marks=marks,
        x=time_axes.time_axis(course.times), title=course.title, title_side="left",
    )  # fmt: skip


def _caption(courses: Sequence[StiffnessHistory], reach_decades: float) -> str:
    what = (
        "Stiffness of the ends in MN m/rad (MN/m per node for a solid class), by each test "
        "and as a state from all tests up to each, with 90 % intervals; the ends stand apart where "
        "the frequencies tell them apart."
        if any(course.state for course in courses)
        else "Rotational stiffness of the ends by each test in MN m/rad, "
        "2/(1/k_deck + 1/k_arch) in each plane, because frequencies alone cannot tell the ends "
        "apart: mean and 90 % credible band."
    )
    levels = (
        f" Dashed: baseline; dash-dotted: thresholds, {10**reach_decades:.2g} times as much or as "
        "little."
        if any(math.isfinite(course.baseline) for course in courses)
        else ""
    )
    fewer = time_axes.thinned_words(max((len(course.times) for course in courses), default=0))
    return (
        f"{what}{levels} A wide band means that the measured modes hardly feel the stiffness."
        f"{fewer}"
    )


def _alt(courses: Sequence[StiffnessHistory]) -> str:
    wording = "; ".join(_last(course) for course in courses)
    return f"End stiffness over time; at last: {wording}."


def _last(course: StiffnessHistory) -> str:
    bounds = course.alone if course.state is None else course.state
    low, middle, high = (float(each[-1]) for each in (bounds.low, bounds.middle, bounds.high))
    if math.isnan(middle):
        return f"{course.title} not known"
    return f"{course.title} {size_of('log10_k', course.unit, Interval(middle, low, high))}"


def _courses(data: HangerReport) -> list[StiffnessHistory]:
    """Return what the watch compares of the ends; each test alone where it compares nothing."""
    states = data.states.within(data.period)
    watched = [each for each in states.quantities if not each.is_tension]
    if watched:
        named = {row.time: row.test for row in data.trend}
        tests = [named.get(time, "test") for time in states.times]
        return [
            StiffnessHistory(
                each.title, states.times, tests, each.read, each.baseline, each.filtered, each.unit
            )
            for each in watched
        ]
    rows = time_axes.dated(data)
    base = end_stiffness(data.baseline, data.hanger) if data.baseline else {}
    return [
        StiffnessHistory(
            formatting.quantity(name),
            [row.time for row in rows],
            [row.row.test for row in rows],
            time_axes.bounds_of([row.row.stiffness.get(name) for row in rows]),
            float(base[name].mean()) if name in base else math.nan,
        )
        for name in sorted({name for row in rows for name in row.row.stiffness})[::-1]
    ]


def _reach(data: HangerReport) -> float:
    return data.hanger.thresholds.stiffness_shift_decades


FIGURE = spec.FigureSpec[HangerReport](
    "stiffness",
    "End stiffness over time",
    lambda data: _specify(_courses(data), _reach(data)),
    lambda data: _caption(_courses(data), _reach(data)),
    lambda data: _alt(_courses(data)),
)
