"""End stiffness over time, of each end and plane as far as the frequencies tell them apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from shm.report import words
from shm.report.figures.timeline import inner
from shm.report.states import QuantityOverTime
from shm.watch.history import Band
from shm_daemon.web.hanger_figures import over_time
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_figures.panels import axis, layout_name, stacked
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import figure


@dataclass(frozen=True, eq=False)
class _Panel:
    """One stiffness over time, log10 of N m/rad, or of N/m a node for a solid class."""

    title: str
    times: Sequence[datetime]
    tests: Sequence[str]
    alone: Band
    baseline: float
    state: QuantityOverTime | None = None


def _panels(view: HangerView) -> list[_Panel]:
    states = view.states
    watched = [] if states is None else [q for q in states.quantities if not q.is_tension]
    if states is None or not watched:
        return [_by_tests(view, name) for name in _names(view)]
    return [_watched(view, quantity) for quantity in watched]


def _names(view: HangerView) -> list[str]:
    """`transverse_end_stiffness` first."""
    return sorted({name for point in view.trend for name in point.stiffness})[::-1]


def _by_tests(view: HangerView, name: str) -> _Panel:
    base = view.baseline.stiffness.get(name) if view.baseline else None
    return _Panel(
        words.quantity(name),
        [point.time for point in view.trend],
        [point.test for point in view.trend],
        over_time.band_of([point.stiffness.get(name) for point in view.trend]),
        base.mean if base else math.nan,
    )


def _watched(view: HangerView, quantity: QuantityOverTime) -> _Panel:
    assert view.states is not None
    named = {point.time: point.test for point in view.trend}
    times = view.states.times
    tests = [named.get(time, "test") for time in times]
    return _Panel(quantity.title, times, tests, quantity.read, quantity.baseline, quantity)


def _draw(view: HangerView) -> dict[str, Any]:
    panels = _panels(view)
    layout = stacked([panel.title for panel in panels], "log10 of stiffness")
    for number, panel in enumerate(panels):
        layout[layout_name("y", number)]["range"] = _range(view, panel)
    traces = [
        {**trace, "showlegend": number == 0 and trace.get("showlegend", True)}
        for number, panel in enumerate(panels)
        for trace in _traces(view, panel, axis("y", number))
    ]
    return figure(
        traces,
        "time of the test (UTC)",
        "",
        xaxis={"type": "date", "anchor": axis("y", len(panels) - 1)},
        hovermode="closest",
        **layout,
    )


def _traces(view: HangerView, panel: _Panel, y: str) -> list[Trace]:
    chosen = over_time.places(panel.alone.middle, panel.alone.low, panel.alone.high)
    when, alone = over_time.picked(panel.times, chosen), over_time.of(panel.alone, chosen)
    names = [panel.tests[place] for place in chosen.tolist()]
    band = alone if panel.state is None else over_time.of(panel.state.filtered, chosen)
    told = "tests, 90 % band" if panel.state is None else "state, 90 % band"
    lines = over_time.band_traces(when, band, told, "purple", yaxis=y)
    return [
        *(lines[:2] if panel.state is None else lines),
        over_time.dots_trace(
            when, alone, names, "test by itself", "quiet" if panel.state else "purple", yaxis=y
        ),
        *_levels(view, panel, y),
    ]


def _levels(view: HangerView, panel: _Panel, y: str) -> list[Trace]:
    if math.isnan(panel.baseline):
        return []
    ends = (min(panel.times), max(panel.times))
    reach = view.hanger.thresholds.stiffness_shift_decades
    levels = (
        (0.0, "baseline", "green", "dash", True),
        (reach, "threshold", "red", "dashdot", True),
        (-reach, "threshold", "red", "dashdot", False),
    )
    return [
        over_time.level_trace(
            ends, panel.baseline + shift, name, hue, dash,
            legendgroup=name, showlegend=shown, yaxis=y,
        )
        for shift, name, hue, dash, shown in levels
    ]  # fmt: skip


def _range(view: HangerView, panel: _Panel) -> list[float]:
    """The baseline with its thresholds, and what is near them of tests and state."""
    reach = view.hanger.thresholds.stiffness_shift_decades
    shown = [inner(panel.alone.middle), panel.baseline + np.array([-reach, reach])]
    if panel.state is not None:
        parts = (panel.state.filtered.low, panel.state.filtered.high)
        shown += [inner(part) for part in parts]
    else:
        shown += [inner(part) for part in (panel.alone.low, panel.alone.high)]
    return over_time.limits(np.concatenate(shown))


def _caption(view: HangerView) -> str:
    reach = view.hanger.thresholds.stiffness_shift_decades
    what = (
        "Stiffness of the ends, log10 of N m/rad (of N/m per node for a solid class), by each test "
        "and as a state from all tests up to each, with 90 % intervals; the ends stand apart where "
        "the frequencies tell them apart."
        if any(panel.state for panel in _panels(view))
        else "Rotational stiffness of the ends by each test, log10 of N m/rad, "
        "2/(1/k_deck + 1/k_arch) in each plane, because frequencies alone cannot tell the ends "
        "apart: mean and 90 % credible band."
    )
    fewer = over_time.thinned_words(len(view.trend))
    levels = (
        f" Dashed: baseline; dash-dotted: thresholds, {reach:.3g} decades either side."
        if view.baseline
        else ""
    )
    return (
        f"{what}{levels} A wide band means that the measured modes hardly feel the stiffness."
        f"{fewer}"
        f"{' The state over time is being worked out.' if view.states is None else ''}"
    )


def _alt(view: HangerView) -> str:
    told = [_last(panel) for panel in _panels(view)]
    return f"End stiffness over time, log10; at last: {'; '.join(told)}."


def _last(panel: _Panel) -> str:
    band = panel.state.filtered if panel.state else panel.alone
    low, middle, high = (float(part[-1]) for part in (band.low, band.middle, band.high))
    if math.isnan(middle):
        return f"{panel.title} not known"
    return f"{panel.title} {middle:.2f} ({low:.2f} to {high:.2f})"


FIGURE = HangerFigure(
    "stiffness",
    "End stiffness over time",
    "trends",
    lambda view: bool(_names(view)),
    _draw,
    _caption,
    _alt,
    height_px=520,
    shows_states=True,
)
