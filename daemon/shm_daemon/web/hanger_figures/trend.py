"""Tension over time: single tests, the state over time with its band, levels and events."""

from __future__ import annotations

import math
import textwrap
from datetime import UTC
from typing import Any

import numpy as np

from shm.report import Interval, words
from shm.report.figures.timeline import inner
from shm.report.states import QuantityOverTime, StatesOverTime, called_words
from shm.store import EventKind, HangerEvent, TrendPoint
from shm.values import TENSION, FloatArray
from shm.values.force_units import ForceUnit
from shm_daemon.web.hanger_figures import over_time
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

_MARGIN = 0.04
_LABEL_ROOM = 0.08
"""Over the thresholds, so that none crosses what is written at the top of a called change."""
_HANDS = {
    EventKind.BASELINE: ("baseline set", "square", "green"),
    EventKind.ADOPTED: ("effect adopted", "diamond", "purple"),
    EventKind.UNDONE: ("adoption undone", "diamond-open", "purple"),
}
"""What people did, which stands at the foot of the figure."""


def _draw(view: HangerView) -> dict[str, Any]:
    times = [point.time for point in view.trend]
    unit = over_time.tension_unit(view.trend)
    tension = over_time.in_unit(over_time.band_of([p.tension_n for p in view.trend]), unit)
    alerted = {e.at for e in view.events if e.kind is EventKind.ALERT}
    alerts = [place for place, time in enumerate(times) if time in alerted]
    chosen = over_time.places(tension.middle, tension.low, tension.high, always=alerts)
    shown, when = over_time.of(tension, chosen), over_time.picked(times, chosen)
    names = [view.trend[place].test for place in chosen.tolist()]
    state = _state(view.states)
    band = (
        over_time.band_traces(when, shown, "tests, 90 % band", "blue")[:2]
        if state is None
        else _state_traces(view.states, state, unit)
    )
    traces = [
        *band,
        over_time.dots_trace(when, shown, names, "test by itself", "quiet" if state else "blue"),
        *_levels(view),
        *_alerts(view, tension.middle),
        *_hands(view),
    ]
    return figure(
        traces,
        "time of the test (UTC)",
        f"tension ({unit.name})",
        xaxis={"type": "date", "range": _time_range(view)},
        yaxis={"range": _range(view, tension.middle, state)},
        yaxis2={"overlaying": "y", "range": [0, 1], "visible": False, "fixedrange": True},
        shapes=_spans(view),
        hovermode="closest",
    )


def _state(states: StatesOverTime | None) -> QuantityOverTime | None:
    """The tension of the state over time, where there is one."""
    found = [] if states is None else [q for q in states.quantities if q.name == TENSION]
    return found[0] if found else None


def _state_traces(
    states: StatesOverTime | None, state: QuantityOverTime, unit: ForceUnit
) -> list[Trace]:
    assert states is not None
    band = over_time.in_unit(state.filtered, unit)
    chosen = over_time.places(band.middle, band.low, band.high)
    when = over_time.picked(states.times, chosen)
    return over_time.band_traces(when, over_time.of(band, chosen), "state, 90 % band", "blue")


def _levels(view: HangerView) -> list[Trace]:
    times = [point.time for point in view.trend]
    ends = (min(times), max(times))
    unit = over_time.tension_unit(view.trend)
    nominal = unit.of(view.hanger.nominal_tension_n)
    levels = [(nominal, "nominal", "ink", "dot")]
    if view.baseline is not None:
        mean, reach = unit.of(view.baseline.tension_n.mean), _reach(view)
        levels += [
            (mean, "baseline", "green", "dash"),
            (mean * (1 + reach), "threshold", "red", "dashdot"),
            (mean * (1 - reach), "threshold", "red", "dashdot"),
        ]
    return [
        over_time.level_trace(
            ends, value, name, hue, dash, legendgroup=name,
            showlegend=name not in [each[1] for each in levels[:number]],
        )
        for number, (value, name, hue, dash) in enumerate(levels)
    ]  # fmt: skip


def _reach(view: HangerView) -> float:
    return view.hanger.thresholds.tension_shift_fraction


def _alerts(view: HangerView, means: FloatArray) -> list[Trace]:
    """A triangle at each test that raised an alert."""
    places = {point.time: place for place, point in enumerate(view.trend)}
    raised = [e for e in view.events if e.kind is EventKind.ALERT and e.at in places]
    if not raised:
        return []
    return [
        {
            "type": "scatter", "mode": "markers", "name": "alert",
            "x": over_time.stamps([event.at for event in raised]),
            "y": [means[places[event.at]] for event in raised],
            "marker": {
                "symbol": "triangle-down-open", "size": 15, "color": colour("red"),
                "line": {"width": 2.5},
            },
            "text": [_wrapped(event.why) for event in raised],
            "hovertemplate": "%{text}<extra></extra>",
        }
    ]  # fmt: skip


def _hands(view: HangerView) -> list[Trace]:
    """At the foot: what people did, by kind."""
    return [
        _foot(name, symbol, hue, found)
        for kind, (name, symbol, hue) in _HANDS.items()
        if (found := [event for event in view.events if event.kind is kind])
    ]


def _foot(name: str, symbol: str, hue: str, events: list[HangerEvent]) -> Trace:
    return {
        "type": "scatter", "mode": "markers", "name": name, "yaxis": "y2",
        "x": over_time.stamps([event.at for event in events]), "y": [0.03] * len(events),
        "marker": {"symbol": symbol, "size": 11, "color": colour(hue)},
        "text": [_wrapped(f"{name} by {event.who}: {event.why}") for event in events],
        "hovertemplate": "%{text}<extra></extra>",
    }  # fmt: skip


def _spans(view: HangerView) -> list[dict[str, Any]]:
    """When each called change began, with 90 % probability."""
    changes = [call.watched.change for call in view.calls]
    return [
        {
            "type": "rect", "yref": "paper", "y0": 0, "y1": 1, "layer": "below",
            "x0": over_time.stamps([change.began_after])[0],
            "x1": over_time.stamps([change.began_by])[0],
            "fillcolor": colour("purple", 0.25),
            "line": {"width": 1, "color": colour("purple", 0.4)},
            "label": {
                "text": called_words(change), "textposition": "top left",
                "font": {"color": colour("purple"), "size": 11},
            },
        }
        for change in changes
    ]  # fmt: skip


def _time_range(view: HangerView) -> list[str]:
    """All tests; what people did later comes into view by a double click."""
    times = [point.time for point in view.trend]
    first, last = min(times), max(times)
    margin_s = max(_MARGIN * (last - first).total_seconds(), 43_200.0)
    ends = (first.timestamp() - margin_s, last.timestamp() + margin_s)
    return over_time.stamps([first.fromtimestamp(end, UTC) for end in ends])


def _range(view: HangerView, means: FloatArray, state: QuantityOverTime | None) -> list[float]:
    """Tests, state, baseline and thresholds; nominal and lone intervals may lie beyond."""
    shown, unit = [means], over_time.tension_unit(view.trend)
    if view.baseline is not None:
        mean = unit.of(view.baseline.tension_n.mean)
        shown.append(np.array([mean * (1 - _reach(view)), mean * (1 + _reach(view))]))
    if state is not None:
        shown += [inner(unit.of(part)) for part in (state.filtered.low, state.filtered.high)]
    else:
        summaries = [point.tension_n for point in view.trend]
        shown.append(inner(unit.of(np.array([each.q05 for each in summaries]))))
        shown.append(inner(unit.of(np.array([each.q95 for each in summaries]))))
    low, high = over_time.limits(np.concatenate(shown))
    return [low, high + (_LABEL_ROOM * (high - low) if view.calls else 0.0)]


def _wrapped(text: str) -> str:
    """Plotly breaks no lines by itself."""
    return "<br>".join(textwrap.wrap(text, 60))


def _caption(view: HangerView) -> str:
    return " ".join(filter(None, (_tests(view), _lines(view), _marks(view), _waits(view))))


def _tests(view: HangerView) -> str:
    states = view.states
    if states is None or _state(states) is None:
        return "Tension by each test: mean and 90 % credible band."
    at = (
        f" at {states.reference_temperature_c:.1f} °C, the swing with the temperature taken out"
        if math.isfinite(states.reference_temperature_c)
        else ""
    )
    return (
        "Dots: the tension by each test alone, as it was that day, with its 90 % interval. Line "
        f"and band: the state from all tests up to each{at}, with its 90 % credible band."
    )


def _lines(view: HangerView) -> str:
    if view.baseline is None:
        return "Dotted: nominal."
    return (
        f"Dotted: nominal; dashed: baseline; dash-dotted: thresholds, {100 * _reach(view):.3g} % "
        "either side of the baseline."
    )


def _marks(view: HangerView) -> str:
    kinds = {event.kind for event in view.events}
    told = [
        "triangles: alerts" if EventKind.ALERT in kinds else "",
        "upright spans: when a called change began, with 90 % probability" if view.calls else "",
        "at the foot: what was set or adopted" if kinds & set(_HANDS) else "",
    ]
    found = "; ".join(filter(None, told))
    fewer = over_time.thinned_words(len(view.trend))
    undated = sum(point.taken_at is None for point in view.trend)
    received = (
        f" {words.counted(undated, 'test')} without a time drawn at the receipt." if undated else ""
    )
    return (found[:1].upper() + found[1:] + "." if found else "") + fewer + received


def _waits(view: HangerView) -> str:
    return "The state over time is being worked out." if view.states is None else ""


def _alt(view: HangerView) -> str:
    unit = over_time.tension_unit(view.trend)
    first, last = (_at(view.trend[place], unit) for place in (0, -1))
    called = [called_words(call.watched.change) for call in view.calls]
    return (
        f"Tension over {words.counted(len(view.trend), 'test')}, {first} at first, "
        f"{last} at last. Changes called: {'; '.join(called) or 'none'}."
    )


def _at(point: TrendPoint, unit: ForceUnit) -> str:
    tension = words.tension(Interval.of_summary(point.tension_n), unit)
    return f"{tension} on {point.time:%Y-%m-%d}"


FIGURE = HangerFigure(
    "trend",
    "Tension over time",
    "trends",
    lambda view: bool(view.trend),
    _draw,
    _caption,
    _alt,
    height_px=440,
    shows_states=True,
)
