"""The tension of a hanger over time, with what the store knows of its events."""

from __future__ import annotations

from shm.report import Interval, words
from shm.report.figures import trend
from shm.report.figures.specification import Symbol
from shm.report.states import CalledChange, called_words
from shm.store import EventKind
from shm.values import TENSION
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView

_HANDS: dict[EventKind, tuple[str, Symbol, bool, str]] = {
    EventKind.BASELINE: ("baseline set", "square", True, "green"),
    EventKind.ADOPTED: ("effect adopted", "diamond", True, "purple"),
    EventKind.UNDONE: ("adoption undone", "diamond", False, "purple"),
}
"""What people did: name, symbol, whether it is filled, colour."""


def course_of(view: HangerView) -> trend.Course:
    """All that the figure shows; without the state over time where that is still worked out."""
    states, places = view.states, {point.time: place for place, point in enumerate(view.trend)}
    found = [] if states is None else [q for q in states.quantities if q.name == TENSION]
    raised = [e for e in view.events if e.kind is EventKind.ALERT and e.at in places]
    changes = [call.watched.change for call in view.calls]
    return trend.Course(
        times=[point.time for point in view.trend],
        names=[point.test for point in view.trend],
        tensions_n=[Interval.of_summary(point.tension_n) for point in view.trend],
        nominal_n=view.hanger.nominal_tension_n,
        baseline_n=view.baseline.tension_n.mean if view.baseline else None,
        reach=view.hanger.thresholds.tension_shift_fraction,
        alerts={places[event.at]: event.why for event in raised},
        state=found[0] if found else None,
        state_times=states.times if states else (),
        reference_temperature_c=states.reference_temperature_c if states else float("nan"),
        changes=[CalledChange(c.began_after, c.began_by, called_words(c)) for c in changes],
        deeds=[
            trend.Deed(*_HANDS[event.kind], event.at, f"by {event.who}: {event.why}")
            for kind in _HANDS
            for event in view.events
            if event.kind is kind
        ],
        remark=_remark(view),
    )


def _remark(view: HangerView) -> str:
    undated = sum(point.taken_at is None for point in view.trend)
    told = (
        f"{words.counted(undated, 'test')} without a time drawn at the receipt." if undated else "",
        "The state over time is being worked out." if view.states is None else "",
    )
    return " ".join(filter(None, told))


FIGURE = HangerFigure(
    "trend",
    "Tension over time",
    "trends",
    lambda view: bool(view.trend),
    lambda view: trend.specify(course_of(view)),
    lambda view: trend.caption(course_of(view)),
    lambda view: trend.alt(course_of(view)),
    height_px=440,
    shows_states=True,
)
