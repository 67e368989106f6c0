"""End stiffness over time, of each plane or, where frequencies tell the ends apart, of each end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
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


def specify(
    courses: Sequence[StiffnessHistory], reach_decades: float, is_on_screen: bool = False
) -> spec.Specification | None:
    """Return side by side on paper, one below the other on a screen, which may be narrow."""
    if not courses:
        return None
    panels = [_panel(course, reach_decades, is_on_screen) for course in courses]
    if is_on_screen:
        return spec.stacked([*(replace(each, x=None) for each in panels[:-1]), panels[-1]], 3.0)
    units = " or ".join(sorted({course.unit for course in courses if course.unit}))
    ends = [float(end) for panel in panels for end in panel.y.range or ()]  # type: ignore[arg-type]
    axis = _axis("", min(ends), max(ends))
    shared = [replace(each, y=axis, shares_y=place > 0) for place, each in enumerate(panels)]
    label = f"stiffness (M{units})" if units else "stiffness (millions)"
    shared[0] = replace(shared[0], y=replace(axis, label=label))
    return spec.Specification(rows=[shared], height_inches=3.0)


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


def _panel(course: StiffnessHistory, reach: float, is_on_screen: bool) -> spec.Panel:
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


def caption(courses: Sequence[StiffnessHistory], reach_decades: float, remark: str = "") -> str:
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
        f"{fewer}{remark}"
    )


def alt(courses: Sequence[StiffnessHistory]) -> str:
    wording = "; ".join(_last(course) for course in courses)
    return f"End stiffness over time; at last: {wording}."


def _last(course: StiffnessHistory) -> str:
    bounds = course.alone if course.state is None else course.state
    low, middle, high = (float(each[-1]) for each in (bounds.low, bounds.middle, bounds.high))
    if math.isnan(middle):
        return f"{course.title} not known"
    return f"{course.title} {size_of('log10_k', course.unit, Interval(middle, low, high))}"


def _courses(data: HangerReport) -> list[StiffnessHistory]:
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
        for name in names_of(row.row.stiffness for row in rows)
    ]


def names_of(rows: Iterable[Mapping[str, object]]) -> list[str]:
    """Return the names of the stiffnesses, `transverse_end_stiffness` first."""
    return sorted({name for row in rows for name in row})[::-1]


def _reach(data: HangerReport) -> float:
    return data.hanger.thresholds.stiffness_shift_decades


FIGURE = spec.FigureSpec[HangerReport](
    "stiffness",
    "Trend of the end stiffness",
    lambda data: specify(_courses(data), _reach(data)),
    lambda data: caption(_courses(data), _reach(data)),
    lambda data: alt(_courses(data)),
)
