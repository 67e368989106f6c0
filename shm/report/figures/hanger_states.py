"""States over time: what each test says, what is known of tension and springs, changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from shm.report.contents import HangerReport
from shm.report.figures import specification as spec
from shm.report.figures import time_axes
from shm.report.states import QuantityOverTime, StatesOverTime
from shm.values import BoolArray
from shm.values.rounding import force_unit
from shm.watch.state import Band as Bounds

# Layout: heights of the panels, and of what stands around them.
_TENSION_INCHES, _STIFFNESS_INCHES, _TEMPERATURE_INCHES = 2.3, 1.5, 0.75
_REST_INCHES = 0.9
_TENSION_TITLE = "tension by the selected model class: estimate to date and retrospective"


def specify(data: StatesOverTime, least_tests: int = 1) -> spec.Specification | None:
    """None of fewer tests."""
    if not any(_known(each) >= least_tests for each in data.quantities):
        return None
    panels = [_panel(data, quantity) for quantity in data.quantities]
    if np.any(np.isfinite(data.temperatures_c)):
        panels.append(_temperature(data))
    panels[-1] = replace(panels[-1], x=time_axes.time_axis(data.times))
    return spec.stacked(panels, sum(panel.height for panel in panels) + _REST_INCHES, 5)


def _known(quantity: QuantityOverTime) -> int:
    """Count the tests at which the state is known."""
    return int(np.isfinite(quantity.filtered.middle).sum())


def _panel(data: StatesOverTime, quantity: QuantityOverTime) -> spec.Panel:
    scale, unit = _scale(quantity)
    whole = np.arange(len(data.times))
    read = time_axes.part(quantity.read, whole, scale)
    filtered = time_axes.part(quantity.filtered, whole, scale)
    smoothed = time_axes.part(quantity.smoothed, whole, scale)
    levels = scale * np.array([quantity.lower_threshold, quantity.upper_threshold])
    baseline = scale * quantity.baseline
    # Lone readings and wide bands may lie beyond.
    bounds = [time_axes.inner(each) for each in (filtered.low, filtered.high)]
    seen = time_axes.inner(read.middle[~data.outlier])
    low, high = spec.limits(filtered.middle, smoothed.middle, *bounds, seen, levels, [baseline])
    is_first = quantity is data.quantities[0]
    changes = time_axes.changes(data.changes, data.times, is_first)
    high += time_axes.LABEL_ROOM * (high - low) * (len(changes) if is_first else 0)
    times: Any = data.times
    look: dict[str, Any] = {"x": times, "colour": "blue"}
    marks: list[spec.Mark] = [
        *changes,
        spec.Band(low=filtered.low, high=filtered.high, opacity=0.22, name="90 % band", **look),
        *_readings(data, read, low, high),
        spec.Line(y=filtered.middle, width=1.5, name="estimate to date", **look),
        spec.Line(
            x=times,
            y=smoothed.middle,
            colour="orange",
            width=1.4,
            dash="dash",
            name="retrospective",
        ),
        time_axes.level(baseline, "baseline", "green", "dash"),
        *(
            time_axes.level(each, "threshold", "red", "dashdot")
            for each in levels[np.isfinite(levels)].tolist()
        ),
    ]
    is_tension = quantity.is_tension
    label = f"tension ({unit})" if is_tension else f"log10 of\n{unit or 'stiffness'}"
    return spec.Panel(
        y=spec.Axis(label=label, range=(low, high)), marks=marks,
        title=_TENSION_TITLE if is_tension else quantity.title, title_side="left",
        height=_TENSION_INCHES if is_tension else _STIFFNESS_INCHES,
    )  # fmt: skip


def _scale(quantity: QuantityOverTime) -> tuple[float, str]:
    """Return the factor from its values to those of its axis, and their unit."""
    if not quantity.is_tension:
        return 1.0, quantity.unit
    unit = force_unit(quantity.baseline, *quantity.filtered.middle.tolist())
    return 1 / unit.newtons, unit.name


def _readings(data: StatesOverTime, read: Bounds, low: float, high: float) -> list[spec.Mark]:
    """Single tests, hollow where taken as outliers, triangles at the edge beyond which they lie."""
    found: list[spec.Mark] = []
    known = np.isfinite(read.middle)
    for chosen, filled, name in (
        (known & ~data.outlier, True, "test by itself"),
        (known & data.outlier, False, "taken as outlier"),
    ):
        if places := np.flatnonzero(chosen).tolist():
            part = time_axes.part(read, np.array(places))
            found.append(
                spec.Points(
                    x=[data.times[place] for place in places], y=part.middle, low=part.low,
                    high=part.high, filled=filled, size=2.8 if filled else 4.2, colour="quiet",
                    opacity=0.7, caps=False, name=name,
                )
            )  # fmt: skip
    beyond: tuple[tuple[BoolArray, float, spec.Symbol], ...] = (
        (read.middle > high, high, "triangle"),
        (read.middle < low, low, "triangle down"),
    )
    for chosen, edge, symbol in beyond:
        if places := np.flatnonzero(chosen).tolist():
            found.append(
                spec.Points(
                    x=[data.times[place] for place in places], y=[edge] * len(places), size=5,
                    symbol=symbol, filled=False, clipped=False, colour="quiet",
                    name="test out of view",
                )
            )  # fmt: skip
    return found


def _temperature(data: StatesOverTime) -> spec.Panel:
    known = np.flatnonzero(np.isfinite(data.temperatures_c)).tolist()
    times = [data.times[place] for place in known]
    curve = spec.Line(
        x=times, y=data.temperatures_c[known], colour="quiet", width=0.8, dots=True
    )  # fmt: skip
    marks: list[spec.Mark] = [curve]
    if np.isfinite(data.reference_temperature_c):
        marks.append(spec.Rule(at=data.reference_temperature_c, colour="green", dash="dash"))
    return spec.Panel(y=spec.Axis(label="temp.\n(°C)"), marks=marks, height=_TEMPERATURE_INCHES)


def _caption(data: StatesOverTime) -> str:
    at = (
        f", at {data.reference_temperature_c:.1f} °C"
        if np.isfinite(data.reference_temperature_c)
        else ""
    )
    return (
        f"Tension and stiffness over time{at}, temperature-compensated. Bands compare tests: what "
        "all tests share is left out, so they are narrower than the absolute interval. Dots: "
        "what each test says by itself with its own 90 % interval, hollow where it was taken as an "
        "outlier, triangles where it lies out of view. Solid: the state from the tests up to each, "
        "with its 90 % band; dashed orange: from all tests. Dashed green: baseline; dash-dotted: "
        "thresholds. Nothing is drawn of a test that no state explains. Upright spans: when a "
        "detected change began, with 90 % probability. At the bottom: temperature of the tests."
    )


def _alt(data: StatesOverTime) -> str:
    last = [_last(quantity) for quantity in data.quantities]
    called = [f"{change.words}, begun by {change.began_by:%Y-%m-%d}" for change in data.changes]
    return (
        f"States over {len(data.times)} tests, at last: {'; '.join(last)}. "
        f"Changes detected: {'; '.join(called) or 'none'}."
    )


def _last(quantity: QuantityOverTime) -> str:
    band = quantity.filtered
    scale, name = _scale(quantity)
    unit = f" {name}" if quantity.is_tension else ""
    known = np.flatnonzero(np.isfinite(band.middle))
    if not len(known):
        return f"{quantity.title} not known"
    low, middle, high = (
        float(part[known[-1]]) * scale for part in (band.low, band.middle, band.high)
    )
    return (
        f"{quantity.title} {middle:.4g}{unit} (90 % interval {low:.4g} to {high:.4g}{unit}), "
        f"baseline {quantity.baseline * scale:.4g}{unit}"
    )


STATES = spec.Member("drift", "States over time", specify, _caption, _alt)
# One test alone has no course: its numbers stand elsewhere in the report.
FIGURE = spec.Member[HangerReport](
    STATES.name,
    STATES.title,
    lambda data: specify(data.states.within(data.period), least_tests=2),
    lambda data: _caption(data.states.within(data.period)),
    lambda data: _alt(data.states.within(data.period)),
)
