"""End stiffness over time, of each end and plane as far as the frequencies tell them apart."""

from __future__ import annotations

import math

from shm.report import Interval, words
from shm.report.figures import stiffness
from shm.report.figures.over_time import bounds_of
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView


def _courses(view: HangerView) -> list[stiffness.Course]:
    states, named = view.states, {point.time: point.test for point in view.trend}
    watched = [] if states is None else [q for q in states.quantities if not q.is_tension]
    if states is None or not watched:
        return [_by_tests(view, name) for name in _names(view)]
    tests = [named.get(time, "test") for time in states.times]
    return [
        stiffness.Course(each.title, states.times, tests, each.read, each.baseline, each.filtered)
        for each in watched
    ]


def _names(view: HangerView) -> list[str]:
    return stiffness.names_of(point.stiffness for point in view.trend)


def _by_tests(view: HangerView, name: str) -> stiffness.Course:
    base = view.baseline.stiffness.get(name) if view.baseline else None
    found = [point.stiffness.get(name) for point in view.trend]
    return stiffness.Course(
        words.quantity(name),
        [point.time for point in view.trend],
        [point.test for point in view.trend],
        bounds_of([Interval.of_summary(each) if each else None for each in found]),
        base.mean if base else math.nan,
    )


def _reach(view: HangerView) -> float:
    return view.hanger.thresholds.stiffness_shift_decades


FIGURE = HangerFigure(
    "stiffness",
    "End stiffness over time",
    "trends",
    lambda view: bool(_names(view)),
    lambda view: stiffness.specify(_courses(view), _reach(view), is_on_screen=True),
    lambda view: stiffness.caption(
        _courses(view),
        _reach(view),
        " The state over time is being worked out." if view.states is None else "",
    ),
    lambda view: stiffness.alt(_courses(view)),
    height_px=520,
    shows_states=True,
)
