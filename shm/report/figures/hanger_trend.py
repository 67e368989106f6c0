"""Tension over time: single tests, the state over time with its band, levels and events."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np

from shm.report import formatting
from shm.report.contents import Deed, HangerReport
from shm.report.figures import specification as spec
from shm.report.figures import time_axes
from shm.report.formatting import Interval
from shm.report.states import CalledChange, QuantityOverTime, StatesOverTime
from shm.values import FloatArray
from shm.values.notes import Note, NoteKind
from shm.values.rounding import ForceUnit, force_unit
from shm.watch.state import Band as Bounds

_LONGEST_WORDS = 200  # layout: characters of a note in a hover; the page has all
_AT_FOOT = 0.03  # layout: of the height, where signs of what people did stand
_LOOKS: dict[str, tuple[spec.Symbol, bool, str]] = {
    "baseline set": ("square", True, "green"),
    "effect adopted": ("diamond", True, "purple"),
    "adoption undone": ("diamond", False, "purple"),
    NoteKind.NOTE: ("thin cross", True, "ink"),
    NoteKind.INSPECTION: ("circle", False, "ink"),
    NoteKind.REPAIR: ("cross", True, "ink"),
}
"""Of what people did, by its kind: symbol, whether it is filled, colour."""


@dataclass(frozen=True, eq=False)
class TensionHistory:
    """The tension of a hanger over time: n tests in N, and what is known beside them.

    `alerts` say by the place of a test why it raised one. `state` is at `state_times`; `changes`
    are those that were detected, None where that is not known. `excluded` are the places of tests
    taken for blunders: no axis reaches to them for their sake. `remark` ends the caption.
    """

    times: Sequence[datetime]
    names: Sequence[str]
    tensions_n: Sequence[Interval]
    nominal_n: float
    baseline_n: float | None
    reach: float
    alerts: Mapping[int, str]
    state: QuantityOverTime | None = None
    state_times: Sequence[datetime] = ()
    reference_temperature_c: float = math.nan
    changes: Sequence[CalledChange] | None = None
    deeds: Sequence[Deed] = ()
    excluded: Collection[int] = ()
    remark: str = ""
    bounds_n: Bounds = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds_n", time_axes.bounds_of(self.tensions_n))

    @property
    def unit(self) -> ForceUnit:
        """The one unit of the figure."""
        return force_unit(*(each.mean for each in self.tensions_n))


def _specify(course: TensionHistory) -> spec.Specification | None:
    if not course.times:
        return None
    scale, bounds = 1 / course.unit.newtons, course.bounds_n
    chosen = time_axes.places(bounds.middle, bounds.low, bounds.high, always=course.alerts)
    shown, when = time_axes.part(bounds, chosen, scale), _picked(course.times, chosen.tolist())
    names = [course.names[place] for place in chosen.tolist()]
    marks = [
        *_state(course, scale),
        time_axes.single_tests(
            when,
            shown,
            names,
            "quiet" if course.state else "blue",
            "test, absolute interval" if _has_repeats(course) else "test by itself",
        ),
        *_levels(course, scale),
        *_alerts(course, scale),
        *_excluded(course, scale),
        *_deeds(course),
        *_repeats(course, chosen.tolist(), scale),
        *time_axes.changes(course.changes or (), _shown(course)),
    ]
    axis = spec.Axis(label=f"tension ({course.unit.name})", range=_range(course, scale))
    return spec.stacked(
        [spec.Panel(y=axis, marks=marks, x=time_axes.time_axis(_shown(course)))], 3.4, 5
    )


def _shown(course: TensionHistory) -> list[datetime]:
    """Return the times of the tests, and of what was noted after the last of them."""
    last = max(course.times)
    return [*course.times, *(each.at for each in course.deeds if each.at > last)]


def _picked(times: Sequence[datetime], chosen: list[int]) -> list[datetime]:
    return [times[place] for place in chosen]


def _state(course: TensionHistory, scale: float) -> list[spec.Mark]:
    if course.state is None:
        return []
    band = course.state.filtered
    chosen = time_axes.places(band.middle, band.low, band.high)
    when = _picked(course.state_times, chosen.tolist())
    return time_axes.band(when, time_axes.part(band, chosen, scale), "blue", "state, 90 % band")


def _has_repeats(course: TensionHistory) -> bool:
    return course.state is None and any(e.repeatability_sd is not None for e in course.tensions_n)


def _repeats(course: TensionHistory, chosen: list[int], scale: float) -> list[spec.Mark]:
    """Return the interval in which the same test would repeat, within the absolute one."""
    if not _has_repeats(course):
        return []
    inner = [
        Interval.normal(
            each.mean, math.nan if each.repeatability_sd is None else each.repeatability_sd
        )
        for each in (course.tensions_n[place] for place in chosen)
    ]
    bounds = time_axes.part(time_axes.bounds_of(inner), np.arange(len(inner)), scale)
    return [
        spec.Points(
            x=_picked(course.times, chosen), y=bounds.middle, low=bounds.low, high=bounds.high,
            colour="orange", size=5.5, filled=False,
            name="90 % repeatability", texts=time_axes.spans(bounds),
        )
    ]  # fmt: skip


def _levels(course: TensionHistory, scale: float) -> list[spec.Mark]:
    levels: list[spec.Mark] = [time_axes.level(scale * course.nominal_n, "nominal", "ink", "dot")]
    if course.baseline_n is not None:
        mean = scale * course.baseline_n
        levels.append(time_axes.level(mean, "baseline", "green", "dash"))
        levels += [
            time_axes.level(mean * (1 + shift), "threshold", "red", "dashdot")
            for shift in (course.reach, -course.reach)
        ]
    return levels


def _alerts(course: TensionHistory, scale: float) -> list[spec.Mark]:
    """Return a triangle at each test that raised an alert."""
    if not course.alerts:
        return []
    raised = list(course.alerts)
    return [
        spec.Points(
            x=_picked(course.times, raised), y=scale * course.bounds_n.middle[raised],
            symbol="triangle down", filled=False, size=10, colour="red", name="alert",
            texts=list(course.alerts.values()),
        )
    ]  # fmt: skip


def _excluded(course: TensionHistory, scale: float) -> list[spec.Mark]:
    """Mark tests taken for blunders; where they lie beyond the view, at its edge."""
    low, high = _range(course, scale)
    found: list[spec.Mark] = []
    for name, is_inside in (("excluded test", True), ("excluded test out of view", False)):
        at = [
            place
            for place in course.excluded
            if bool(low <= scale * course.bounds_n.middle[place] <= high) is is_inside
        ]
        if at:
            y = np.clip(scale * course.bounds_n.middle[at], low, high)
            symbol: spec.Symbol = "thin cross" if is_inside else "triangle"
            found.append(
                spec.Points(
                    x=_picked(course.times, at), y=y, symbol=symbol, size=7, colour="ink",
                    clipped=False, name=name, texts=[course.names[place] for place in at],
                )
            )  # fmt: skip
    return found


def _deeds(course: TensionHistory) -> list[spec.Mark]:
    """Return the marks of what people did and noted, by kind."""
    marks: list[spec.Mark] = []
    for kind in dict.fromkeys(each.kind for each in course.deeds):
        symbol, filled, colour = _LOOKS[kind]
        deeds = [each for each in course.deeds if each.kind == kind]
        marks.append(
            spec.Points(
                x=[each.at for each in deeds], y=[_AT_FOOT] * len(deeds), in_shares=True,
                symbol=symbol, filled=filled, size=7, colour=colour, name=kind,
                texts=[f"{kind} {each.why}" for each in deeds],
            )
        )  # fmt: skip
    return marks


def _noted(note: Note) -> Deed:
    words = textwrap.shorten(note.text, _LONGEST_WORDS)
    return Deed(note.kind, note.at, f"of {note.of} by {note.who}: {words}")


def _range(course: TensionHistory, scale: float) -> tuple[float, float]:
    """Return the range of tests, state, baseline, thresholds and a nominal tension close by.

    Single wide intervals may exceed it.
    """
    counted = np.ones(len(course.times), bool)
    counted[list(course.excluded)] = len(course.excluded) == len(course.times)
    seen: list[FloatArray] = [course.bounds_n.middle[counted]]
    if course.baseline_n is not None:
        seen.append(course.baseline_n * np.array([1 - course.reach, 1 + course.reach]))
    if course.state is None:
        lows, highs = course.bounds_n.low[counted], course.bounds_n.high[counted]
    else:
        lows, highs = course.state.filtered.low, course.state.filtered.high
    seen += [time_axes.inner(lows), time_axes.inner(highs)]
    low, high = spec.limits(*seen)
    if 2 * low - high < course.nominal_n < 2 * high - low:
        low, high = spec.limits(*seen, [course.nominal_n])
    written = time_axes.LABEL_ROOM * len(course.changes or ())
    return scale * low, scale * (high + written * (high - low))


def _caption(course: TensionHistory) -> str:
    parts = (_tests(course), _lines(course), _marks(course), course.remark)
    return " ".join(part for part in parts if part)


def _tests(course: TensionHistory) -> str:
    if course.state is None:
        repeats = (
            " Capped orange bars: where the same test would fall again with 90 % probability "
            "(repeatability), by which tests are compared."
            if _has_repeats(course)
            else ""
        )
        return (
            "Tension by each test, averaged over the model classes. Thin bars: 90 % credible "
            f"interval, absolute.{repeats}"
        )
    at = (
        f" at {course.reference_temperature_c:.1f} °C, temperature-compensated"
        if math.isfinite(course.reference_temperature_c)
        else ""
    )
    return (
        "Dots: the tension by each test alone, averaged over the model classes, as it was that "
        "day, with its 90 % interval. Line "
        f"and band: the state from all tests up to each{at}, with its 90 % credible band."
    )


def _lines(course: TensionHistory) -> str:
    if course.baseline_n is None:
        return "Dotted: nominal."
    return (
        f"Dotted: nominal; dashed: baseline; dash-dotted: thresholds, {100 * course.reach:.3g} % "
        "either side of the baseline."
    )


def _marks(course: TensionHistory) -> str:
    wording = [
        "triangles: alerts" if course.alerts else "",
        "upright spans: when a detected change began, with 90 % probability"
        if course.changes
        else "",
        "crosses, or triangles at the edge: tests taken for blunders" if course.excluded else "",
        "at the foot: what was set, adopted, seen or repaired" if course.deeds else "",
    ]
    found = "; ".join(filter(None, wording))
    fewer = time_axes.thinned_words(len(course.times))
    return ((found[:1].upper() + found[1:] + "." if found else "") + fewer).strip()


def _alt(course: TensionHistory) -> str:
    first, last = (
        f"{formatting.tension(course.tensions_n[place], course.unit)} on "
        f"{course.times[place]:%Y-%m-%d}"
        for place in (0, -1)
    )
    called = (
        f" Changes detected: {'; '.join(change.words for change in course.changes) or 'none'}."
        if course.changes is not None
        else ""
    )
    count = formatting.counted(len(course.times), "test")
    return f"Tension over {count}, {first} at first, {last} at last.{called}"


def _course(data: HangerReport) -> TensionHistory:
    rows = time_axes.dated(data)
    alerted = {alert.test: alert.message for alert in data.alerts}
    undated = len(data.trend) - len(rows)
    baseline_n = data.now.baseline_n
    states = data.states.within(data.period)
    left = f"{formatting.counted(undated, 'test')} without a time left out." if undated else ""
    return TensionHistory(
        times=[row.time for row in rows],
        names=[row.row.test for row in rows],
        tensions_n=[row.row.tension_n for row in rows],
        nominal_n=data.hanger.nominal_tension_n,
        baseline_n=baseline_n.mean if baseline_n else None,
        reach=data.hanger.thresholds.tension_shift_fraction,
        alerts={i: alerted[r.row.test] for i, r in enumerate(rows) if r.row.test in alerted},
        deeds=(*data.deeds, *map(_noted, data.inspections)),
        excluded=_excluded_places([row.time for row in rows], states),
        state=_averaged_state(states, baseline_n.mean) if baseline_n else None,
        state_times=states.times,
        reference_temperature_c=states.reference_temperature_c,
        changes=states.changes if states.times else None,
        remark=left,
    )


def _averaged_state(states: StatesOverTime, baseline_n: float) -> QuantityOverTime | None:
    """Return the state of the tension at the level of the average over classes.

    It is of one model class: of a change all classes say the same fraction, so the band, which
    compares tests, moves along with the tension of the baseline `baseline_n`.
    """
    found = next((each for each in states.quantities if each.is_tension), None)
    if found is None or not np.isfinite(found.filtered.middle).any():
        return None
    whole = np.arange(len(found.filtered.middle))
    ratio = baseline_n / found.baseline
    return replace(found, filtered=time_axes.part(found.filtered, whole, ratio))


def _excluded_places(times: Sequence[datetime], states: StatesOverTime) -> tuple[int, ...]:
    """Return the places of the tests that the watch takes for blunders."""
    outliers = {
        time for time, is_outlier in zip(states.times, states.outlier, strict=True) if is_outlier
    }
    return tuple(place for place, time in enumerate(times) if time in outliers)


FIGURE = spec.FigureSpec[HangerReport](
    "trend",
    "Trend of the tension",
    lambda data: _specify(_course(data)),
    lambda data: _caption(_course(data)),
    lambda data: _alt(_course(data)),
)
