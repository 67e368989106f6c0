"""Draw the tension over time: single tests, the state over time with its band, levels, events."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from shm.report import formatting
from shm.report.contents import Deed, HangerReport
from shm.report.figures import specification as spec
from shm.report.figures import time_axes
from shm.report.states import QuantityOverTime
from shm.values import FloatArray
from shm.values.notes import Note, NoteKind
from shm.watch.engine.state import Band as Bounds

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


def _specify(data: HangerReport) -> spec.Specification | None:
    """Return the tension in the one unit of the report, over the temperature where it is known.

    None without a test of a known time.
    """
    rows = data.dated_trend
    if not rows:
        return None
    times = [row.time for row in rows]
    scale, bounds, state = 1 / data.tension_unit.newtons, _bounds(data), _state(data)
    alerts = _alerts(data)
    chosen = time_axes.places(bounds.middle, bounds.low, bounds.high, always=alerts)
    view = _view(data, scale)
    last = max(times)
    shown = [*times, *(each.at for each in _deeds(data) if each.at > last)]
    marks = [
        *_band(state, data.states.within(data.period).times, scale),
        time_axes.single_tests(
            _picked(times, chosen),
            time_axes.part(bounds, chosen, scale),
            [rows[place].row.test for place in chosen],
            "quiet" if state else "blue",
        ),
        *_levels(data, scale),
        *_places("alert", "triangle down", "red", alerts, times, scale * bounds.middle),
        *_places(
            "excluded test", "thin cross", "ink",
            {place: rows[place].row.test for place in _excluded(data)},
            times, np.clip(scale * bounds.middle, *view),
        ),
        *_signs(_deeds(data)),
        *time_axes.changes(data.states.within(data.period).changes, shown),
    ]  # fmt: skip
    axis = spec.Axis(label=f"tension ({data.tension_unit.name})", range=view)
    tension = spec.Panel(y=axis, marks=marks, x=time_axes.time_axis(shown))
    temperature = _temperature(data)
    if temperature is None:
        return spec.stacked([tension], 3.4, 5)
    return spec.stacked([replace(tension, x=None), replace(temperature, x=tension.x)], 4.2, 5)


def _temperature(data: HangerReport) -> spec.Panel | None:
    """Return a strip of the temperature at each dated test; None where none is known."""
    known = [each for each in data.dated_trend if math.isfinite(each.row.temperature_c)]
    if not known:
        return None
    degrees = np.array([each.row.temperature_c for each in known])
    chosen = time_axes.places(degrees)
    tests = spec.Points(
        x=_picked([each.time for each in known], chosen), y=degrees[chosen], colour="orange",
        size=3.6, texts=[f"{known[i].row.test}: {degrees[i]:.1f} °C" for i in chosen],
    )  # fmt: skip
    low, high = spec.limits(degrees, room=0.2)
    axis = spec.Axis(label="°C", range=(min(low, high - 5), high))
    return spec.Panel(y=axis, marks=[tests], height=0.28)  # layout: as a share of the tension's


def _bounds(data: HangerReport) -> Bounds:
    """Return the tension by each dated test with its 90 % interval, in N."""
    return time_axes.bounds_of([row.row.tension_n for row in data.dated_trend])


def _state(data: HangerReport) -> QuantityOverTime | None:
    """Return the state of the tension at the level of the average over classes.

    It is of one model class: of a change all classes say the same fraction, so the band, which
    compares tests, moves along with the tension of the baseline.
    """
    quantities = data.states.within(data.period).quantities
    found = next((each for each in quantities if each.is_tension), None)
    if found is None or data.now.baseline_n is None or not np.isfinite(found.filtered.middle).any():
        return None
    whole = np.arange(len(found.filtered.middle))
    ratio = data.now.baseline_n.mean / found.baseline
    return replace(found, filtered=time_axes.part(found.filtered, whole, ratio))


def _excluded(data: HangerReport) -> list[int]:
    """Return the places of the dated tests that the watch takes for blunders."""
    pairs = zip(data.states.times, data.states.outlier, strict=True)
    outliers = {time for time, is_outlier in pairs if is_outlier}
    return [place for place, row in enumerate(data.dated_trend) if row.time in outliers]


def _alerts(data: HangerReport) -> dict[int, str]:
    """Return why a dated test raised an alert, by its place."""
    messages = {alert.test: alert.message for alert in data.alerts}
    tests = enumerate(row.row.test for row in data.dated_trend)
    return {place: messages[test] for place, test in tests if test in messages}


def _deeds(data: HangerReport) -> tuple[Deed, ...]:
    """Return what people set, adopted and noted."""
    return (*data.deeds, *map(_noted, data.inspections))


def _noted(note: Note) -> Deed:
    words = textwrap.shorten(note.text, _LONGEST_WORDS)
    return Deed(note.kind, note.at, f"of {note.of} by {note.who}: {words}")


def _picked(times: Sequence[datetime], chosen: Iterable[int]) -> list[datetime]:
    return [times[place] for place in chosen]


def _band(
    state: QuantityOverTime | None, times: Sequence[datetime], scale: float
) -> list[spec.Mark]:
    if state is None:
        return []
    band = state.filtered
    chosen = time_axes.places(band.middle, band.low, band.high)
    shown = time_axes.part(band, chosen, scale)
    return time_axes.band(_picked(times, chosen), shown, "blue", "state, 90 % band")


def _levels(data: HangerReport, scale: float) -> list[spec.Mark]:
    nominal = scale * data.hanger.nominal_tension_n
    levels: list[spec.Mark] = [time_axes.level(nominal, "nominal", "ink", "dot")]
    if (baseline := data.now.baseline_n) is not None:
        mean, reach = scale * baseline.mean, _reach(data)
        levels.append(time_axes.level(mean, "baseline", "green", "dash"))
        levels += [
            time_axes.level(mean * (1 + shift), "threshold", "red", "dashdot")
            for shift in (reach, -reach)
        ]
    return levels


def _reach(data: HangerReport) -> float:
    return data.hanger.thresholds.tension_shift_fraction


def _places(
    name: str, symbol: spec.Symbol, colour: str, texts: dict[int, str],
    times: Sequence[datetime], y: FloatArray,
) -> list[spec.Mark]:  # fmt: skip
    """Mark the tests at the places of `texts`; nothing where there are none."""
    if not texts:
        return []
    at = list(texts)
    return [
        spec.Points(
            x=_picked(times, at), y=y[at], symbol=symbol, filled=False, size=10, colour=colour,
            clipped=False, name=name, texts=list(texts.values()),
        )
    ]  # fmt: skip


def _signs(deeds: Sequence[Deed]) -> list[spec.Mark]:
    """Return the marks of what people did and noted, by kind."""
    marks: list[spec.Mark] = []
    for kind in dict.fromkeys(each.kind for each in deeds):
        symbol, filled, colour = _LOOKS[kind]
        these = [each for each in deeds if each.kind == kind]
        marks.append(
            spec.Points(
                x=[each.at for each in these], y=[_AT_FOOT] * len(these), in_shares=True,
                symbol=symbol, filled=filled, size=7, colour=colour, name=kind,
                texts=[f"{kind} {each.why}" for each in these],
            )
        )  # fmt: skip
    return marks


def _view(data: HangerReport, scale: float) -> tuple[float, float]:
    """Return the range of tests, headline, state, baseline, thresholds and a nominal close by.

    No axis reaches to an excluded test for its sake; single wide intervals may exceed it.
    """
    bounds, excluded = _bounds(data), _excluded(data)
    counted = np.ones(len(bounds.middle), bool)
    counted[excluded] = len(excluded) == len(counted)
    seen: list[FloatArray] = [bounds.middle[counted]]
    if data.now.is_determined:
        seen.append(np.array([data.tension_n.low, data.tension_n.high]))
    if (baseline := data.now.baseline_n) is not None:
        seen.append(baseline.mean * np.array([1 - _reach(data), 1 + _reach(data)]))
    if (state := _state(data)) is not None:
        seen += [time_axes.inner(each) for each in (state.filtered.low, state.filtered.high)]
    else:
        seen += [time_axes.inner(each[counted]) for each in (bounds.low, bounds.high)]
    low, high = spec.limits(*seen)
    if 2 * low - high < data.hanger.nominal_tension_n < 2 * high - low:
        low, high = spec.limits(*seen, [data.hanger.nominal_tension_n])
    written = time_axes.LABEL_ROOM * len(data.states.within(data.period).changes)
    return scale * low, scale * (high + written * (high - low))


def _caption(data: HangerReport) -> str:
    rows, states = data.dated_trend, data.states.within(data.period)
    tests = (
        "Tension by each test, averaged over the model classes. Bars: 90 % credible interval, "
        "absolute."
    )
    if _state(data) is not None:
        at_c = data.states.reference_temperature_c
        at = f" at {at_c:.1f} °C, temperature-compensated" if math.isfinite(at_c) else ""
        tests = (
            "Dots: the tension by each test alone, averaged over the model classes, as it was that "
            f"day, with its 90 % interval. Line and band: the state from all tests up to each{at}, "
            "with its 90 % credible band."
        )
    lines = "Dotted: nominal"
    if data.now.baseline_n is not None:
        lines += (
            f"; dashed: baseline; dash-dotted: thresholds, {100 * _reach(data):.3g} % either side "
            "of the baseline"
        )
    marks = [
        "triangles: alerts" if _alerts(data) else "",
        "upright spans: when a detected change began, with 90 % probability"
        if states.changes
        else "",
        "crosses: tests taken for blunders, at the edge where they lie beyond it"
        if _excluded(data)
        else "",
        "at the foot: what was set, adopted, seen or repaired" if _deeds(data) else "",
    ]
    found = "; ".join(filter(None, marks))
    undated = len(data.trend) - len(rows)
    parts = (
        tests,
        f"{lines}.",
        f"{found[:1].upper()}{found[1:]}." if found else "",
        "Below: the temperature at each test." if _temperature(data) else "",
        time_axes.thinned_words(len(rows)).strip(),
        f"{formatting.counted(undated, 'test')} without a time left out." if undated else "",
    )
    return " ".join(filter(None, parts))


def _alt(data: HangerReport) -> str:
    rows, states = data.dated_trend, data.states.within(data.period)
    first, last = (
        f"{formatting.tension(each.row.tension_n, data.tension_unit)} on {each.time:%Y-%m-%d}"
        for each in (rows[0], rows[-1])
    )
    changes = "; ".join(change.words for change in states.changes) or "none"
    called = f" Changes detected: {changes}." if states.times else ""
    count = formatting.counted(len(rows), "test")
    return f"Tension over {count}, {first} at first, {last} at last.{called}"


FIGURE = spec.FigureSpec[HangerReport]("trend", "Trend of the tension", _specify, _caption, _alt)
