"""Draw the figures of a hanger's page: tests over time and temperature, model fit, causes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shm.report import formatting
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.figures import (
    control_chart,
    gap_before_and_after,
    gap_causes,
    gap_map,
    hanger_stiffness,
    hanger_trend,
)
from shm.report.figures.gap_map import measured, retained
from shm.report.figures.hanger_frequencies import FIGURE as OF_REPORT
from shm.report.figures.hanger_frequencies import compared_modes
from shm.report.figures.specification import Axis, Panel, Specification, Symbol, stacked
from shm.report.figures.time_axes import bounds_of, part, places, single_tests, thinned_words
from shm.report.formatting import Interval
from shm.report.states import CalledChange, called_words
from shm.store import EventKind, TrendPoint
from shm.values.rounding import ForceUnit, force_unit
from shm.watch.control_chart import ControlChart
from shm_daemon.web import with_plotly
from shm_daemon.web.hanger_view import HangerView


@dataclass(frozen=True)
class HangerFigure:
    """A figure, and where on the page it stands (`part`).

    `is_there` says whether the hanger has what it shows and costs next to nothing beside the page;
    `draw` gives its specification, `caption` explains what is seen, `alt` says what a blind
    reader needs. What `shows_states` is not whole while the states over time are worked out; what
    `is_wide` scrolls on a phone.
    """

    name: str
    title: str
    part: str
    is_there: Callable[[HangerView], bool]
    draw: Callable[[HangerView], object]
    caption: Callable[[HangerView], str]
    alt: Callable[[HangerView], str]
    height_px: int = 360
    shows_states: bool = False
    is_wide: bool = False

    def document(self, view: HangerView) -> dict[str, Any]:
        """Return the plotly document with its words."""
        found = self.draw(view)
        assert isinstance(found, Specification)
        return with_plotly.with_words(found, self.caption(view), self.alt(view))


_HANDS: dict[EventKind, tuple[str, Symbol, bool, str]] = {
    EventKind.BASELINE: ("baseline set", "square", True, "green"),
    EventKind.ADOPTED: ("effect adopted", "diamond", True, "purple"),
    EventKind.UNDONE: ("adoption undone", "diamond", False, "purple"),
}
"""What people did: name, symbol, whether it is filled, colour."""


def _course(view: HangerView) -> hanger_trend.TensionHistory:
    """Return the data of the trend; without the state over time while that is computed."""
    states, at = view.states, {point.time: place for place, point in enumerate(view.trend)}
    baseline = view.baseline
    baseline_n = baseline.averaged.tension_n.mean if baseline else None
    raised = [e for e in view.events if e.kind is EventKind.ALERT and e.at in at]
    changes = [call.watched.change for call in view.calls]
    return hanger_trend.TensionHistory(
        times=[point.time for point in view.trend],
        names=[point.test for point in view.trend],
        tensions_n=[Interval.of_averaged(point.averaged) for point in view.trend],
        nominal_n=view.hanger.nominal_tension_n,
        baseline_n=baseline_n,
        reach=view.hanger.thresholds.tension_shift_fraction,
        alerts={at[event.at]: event.why for event in raised},
        state=hanger_trend.averaged_state(states, baseline_n) if states and baseline_n else None,
        state_times=states.times if states else (),
        reference_temperature_c=states.reference_temperature_c if states else math.nan,
        changes=[CalledChange(c.began_after, c.began_by, called_words(c)) for c in changes],
        deeds=[
            hanger_trend.TrendEvent(*_HANDS[event.kind], event.at, f"by {event.who}: {event.why}")
            for kind in _HANDS
            for event in view.events
            if event.kind is kind
        ],
        notes=view.notes,
        excluded=hanger_trend.excluded([point.time for point in view.trend], states)
        if states
        else (),
        remark=_remark(view),
    )


def _remark(view: HangerView) -> str:
    undated = sum(point.taken_at is None for point in view.trend)
    sentences = (
        f"{formatting.counted(undated, 'test')} without a time drawn at the receipt."
        if undated
        else "",
        "The state over time is being worked out." if view.states is None else "",
    )
    return " ".join(filter(None, sentences))


def _courses(view: HangerView) -> list[hanger_stiffness.StiffnessHistory]:
    states, named = view.states, {point.time: point.test for point in view.trend}
    watched = [] if states is None else [q for q in states.quantities if not q.is_tension]
    if states is None or not watched:
        return [_by_tests(view, name) for name in _names(view)]
    tests = [named.get(time, "test") for time in states.times]
    return [
        hanger_stiffness.StiffnessHistory(
            each.title, states.times, tests, each.read, each.baseline, each.filtered, each.unit
        )
        for each in watched
    ]


def _names(view: HangerView) -> list[str]:
    return hanger_stiffness.names_of(point.stiffness for point in view.trend)


def _by_tests(view: HangerView, name: str) -> hanger_stiffness.StiffnessHistory:
    base = view.baseline.stiffness.get(name) if view.baseline else None
    found = [point.stiffness.get(name) for point in view.trend]
    return hanger_stiffness.StiffnessHistory(
        formatting.quantity(name),
        [point.time for point in view.trend],
        [point.test for point in view.trend],
        bounds_of([Interval.of_summary(each) if each else None for each in found]),
        base.mean if base else math.nan,
    )


def _reach(view: HangerView) -> float:
    return view.hanger.thresholds.stiffness_shift_decades


def tension_unit(points: Sequence[TrendPoint]) -> ForceUnit:
    """Return the one unit of the tensions of a hanger's tests."""
    return force_unit(*(point.averaged.tension_n.mean for point in points))


def _with_temperature(view: HangerView) -> list[TrendPoint]:
    """Return the tests with a temperature."""
    return [point for point in view.trend if math.isfinite(point.temperature_c)]


def _over_temperature(view: HangerView) -> Specification:
    """Return thinned by tension and temperature where there are very many."""
    known, unit = _with_temperature(view), tension_unit(view.trend)
    bounds = bounds_of([Interval.of_averaged(point.averaged) for point in known])
    temperatures = np.array([point.temperature_c for point in known])
    chosen = places(bounds.middle, temperatures)
    shown = part(bounds, chosen, 1 / unit.newtons)
    names = [f"{known[i].test}, {known[i].time:%Y-%m-%d}" for i in chosen.tolist()]
    earlier, latest = np.arange(len(chosen) - 1), np.array([len(chosen) - 1])
    x = temperatures[chosen]
    marks = [
        single_tests(x[earlier], part(shown, earlier), names[:-1], "blue", "earlier tests", 4.8),
        replace(
            single_tests(x[latest], part(shown, latest), names[-1:], "orange", "latest", 4.8),
            symbol="diamond",
        ),
    ]
    axis = Axis(label=f"tension ({unit.name})")
    return stacked([Panel(y=axis, marks=marks, x=Axis(label="temperature (°C)"))], 3.4)


def _caption_of_temperature(view: HangerView) -> str:
    known = len(_with_temperature(view))
    without = len(view.trend) - known
    left = (
        f" {formatting.counted(without, 'test')} without a temperature left out." if without else ""
    )
    return (
        "Tension by each test over its temperature, with 90 % intervals. A hanger that stays as it "
        f"is lies along one line; what leaves it has another reason than the weather.{left}"
        f"{thinned_words(known)}"
    )


def _alt_of_temperature(view: HangerView) -> str:
    known = _with_temperature(view)
    temperatures = [point.temperature_c for point in known]
    means_n = [point.averaged.tension_n.mean for point in known]
    unit = tension_unit(view.trend)
    low, high = (
        f"{unit.of(each):.{unit.decimals(each)}f}" for each in (min(means_n), max(means_n))
    )
    return (
        f"Tension of {formatting.counted(len(known), 'test')} between {min(temperatures):.1f} and "
        f"{max(temperatures):.1f} °C: {low} to {high} {unit.name}."
    )


def _sheet(view: HangerView) -> DiagnosisSheet:
    assert view.sheet is not None
    return view.sheet


def _shrinks(view: HangerView) -> bool:
    if view.sheet is None or view.sheet.diagnosis.verdict.claim is None:
        return False
    return any(math.isfinite(residual.after_percent) for residual in retained(view.sheet))


def report_of(view: HangerView) -> HangerReport:
    """Return the report of a view that has one."""
    assert view.report is not None
    return view.report


def _control(view: HangerView) -> ControlChart | None:
    """Return the chart of a control hanger; None of any other."""
    return view.report.now.control if view.report else None


FIGURES: tuple[HangerFigure, ...] = (
    HangerFigure(
        "control",
        control_chart.FIGURE.title,
        "trends",
        lambda view: _control(view) is not None,
        lambda view: control_chart.specify(_control(view)),
        lambda view: control_chart.FIGURE.caption(_control(view)),
        lambda view: control_chart.FIGURE.alt(_control(view)),
    ),
    HangerFigure(
        "trend",
        "Tension over time",
        "trends",
        lambda view: bool(view.trend),
        lambda view: hanger_trend.specify(_course(view)),
        lambda view: hanger_trend.caption(_course(view)),
        lambda view: hanger_trend.alt(_course(view)),
        height_px=440,  # judgement: the usual, with signs of what people did above it
        shows_states=True,
    ),
    HangerFigure(
        "stiffness",
        "End stiffness over time",
        "trends",
        lambda view: bool(_names(view)),
        lambda view: hanger_stiffness.specify(_courses(view), _reach(view), is_on_screen=True),
        lambda view: hanger_stiffness.caption(
            _courses(view),
            _reach(view),
            " The state over time is being worked out." if view.states is None else "",
        ),
        lambda view: hanger_stiffness.alt(_courses(view)),
        height_px=520,  # judgement: a low panel for each of up to four springs
        shows_states=True,
    ),
    HangerFigure(
        "temperature",
        "Tension and temperature",
        "trends",
        lambda view: len(_with_temperature(view)) > 1,
        _over_temperature,
        _caption_of_temperature,
        _alt_of_temperature,
    ),
    HangerFigure(
        "frequencies",
        OF_REPORT.title,
        "model",
        lambda view: view.report is not None and bool(compared_modes(view.report)),
        lambda view: OF_REPORT.draw(report_of(view)),
        lambda view: OF_REPORT.caption(report_of(view)),
        lambda view: OF_REPORT.alt(report_of(view)),
        height_px=380,  # judgement: the usual, with words below the axis
    ),
    HangerFigure(
        "gap_map",
        gap_map.FIGURE.title,
        "gap_details",
        lambda view: view.sheet is not None and bool(measured(view.sheet)),
        lambda view: gap_map.specify(_sheet(view), is_on_screen=True),
        lambda view: gap_map.caption(_sheet(view), is_on_screen=True),
        lambda view: gap_map.FIGURE.alt(_sheet(view)),
        height_px=480,  # judgement: a row for each plane and test
    ),
    HangerFigure(
        "gap_places",
        "Where along the hanger",
        "gap_details",
        lambda view: view.sheet is not None and bool(gap_map.local(view.sheet)),
        lambda view: stacked([gap_map.profiles(_sheet(view))], 2.2),
        lambda view: (
            "Where along the hanger a local cause of each kind would have to sit, were it of that "
            "kind, with the share of the misfit that it would explain there."
        ),
        lambda view: gap_map.places_in_words(_sheet(view)),
        height_px=300,  # judgement: one low panel
    ),
    HangerFigure(
        "causes",
        gap_causes.FIGURE.title,
        "gap",
        lambda view: view.sheet is not None and bool(view.sheet.diagnosis.causes),
        lambda view: gap_causes.specify_on_screen(_sheet(view)),
        lambda view: gap_causes.caption(_sheet(view), is_on_screen=True),
        lambda view: gap_causes.FIGURE.alt(_sheet(view)),
        height_px=560,  # judgement: three lines of text for each of ten causes
    ),
    HangerFigure(
        "before_and_after",
        "How far the gap shrinks",
        "gap_details",
        _shrinks,
        lambda view: gap_before_and_after.specify(_sheet(view), is_on_screen=True),
        lambda view: gap_before_and_after.BEFORE_AND_AFTER.caption(_sheet(view)),
        lambda view: gap_before_and_after.BEFORE_AND_AFTER.alt(_sheet(view)),
        height_px=480,  # judgement: a panel for each plane
    ),
)
"""In reading order; a new one is a line here."""
