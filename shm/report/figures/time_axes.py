"""Marks over time: bands, single tests with their intervals, levels, fewer points."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime, timedelta

import numpy as np

from shm.report.figures import specification as spec
from shm.report.formatting import Interval
from shm.report.states import CalledChange
from shm.values import FloatArray, IntArray
from shm.watch.engine.state import Band as Bounds

TIME = "time of the test (UTC)"
MOST_POINTS = 1_000
"""Of which a figure is thinned: a hanger with a test a day for three years is drawn whole."""
_BINS = MOST_POINTS // 6
_MARGIN = 0.04
_LEAST_MARGIN = timedelta(days=1)
_REACH = 3.0
_THINNEST = 0.004
"""Width of the span of a change, as a share of the axis."""
LABEL_ROOM = 0.08
"""Above a figure for each line of what is written over changes, as a share of its height."""


def places(*curves: FloatArray, always: Collection[int] = ()) -> IntArray:
    """Return indices (m,) of what to draw of curves (n,): of each bin the extremes of every curve.

    The first, the last and those of `always` stay whatever they are.
    """
    count = len(curves[0])
    if count <= MOST_POINTS:
        return np.arange(count)
    chosen = [spec.envelope_places(curve, _BINS) for curve in curves]
    retained = np.array(sorted({0, count - 1, *always}), dtype=np.int64)
    return np.unique(np.concatenate([*chosen, retained]))


def thinned_words(count: int) -> str:
    """Return, after a space, that a figure of so many tests shows only some; else nothing."""
    if count <= MOST_POINTS:
        return ""
    return f" Of {count} tests those are drawn that keep every extreme; enlarging brings no more."


def bounds_of(intervals: Sequence[Interval | None]) -> Bounds:
    """Return means with their 90 % intervals, NaN where there is none."""
    rows = [(each.low, each.mean, each.high) if each else (np.nan,) * 3 for each in intervals]
    return Bounds(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)


def part(bounds: Bounds, chosen: IntArray, scale: float = 1.0) -> Bounds:
    """Return the bounds of some tests, times `scale`."""
    low, middle, high = bounds.low[chosen], bounds.middle[chosen], bounds.high[chosen]
    return Bounds(scale * low, scale * middle, scale * high)


def band(times: Sequence[datetime], bounds: Bounds, colour: str, name: str = "") -> list[spec.Mark]:
    """Return a band and, under a name, its middle line."""
    marks: list[spec.Mark] = [
        spec.Band(x=times, low=bounds.low, high=bounds.high, colour=colour, opacity=0.2)
    ]
    if name:
        marks.append(
            spec.Line(
                x=times, y=bounds.middle, colour=colour, width=1.5, name=name, hover="%{text}",
                texts=spans(bounds),
            )
        )  # fmt: skip
    return marks


def spans(bounds: Bounds) -> list[str]:
    """Return `702.3 (90 %: 690.1 to 714.5)` of each."""
    rows = zip(bounds.low, bounds.middle, bounds.high, strict=True)
    return [f"{middle:.4g} (90 %: {low:.4g} to {high:.4g})" for low, middle, high in rows]


def single_tests(
    x: spec.Values, bounds: Bounds, names: Sequence[str], colour: str,
    name: str = "test by itself", size: float = 3.6,
) -> spec.Points:  # fmt: skip
    """Return single tests as marks with their 90 % intervals."""
    wording = zip(names, spans(bounds), strict=True)
    return spec.Points(
        x=x, y=bounds.middle, low=bounds.low, high=bounds.high, caps=False, colour=colour,
        size=size, name=name, texts=[f"{test}: {span}" for test, span in wording],
    )  # fmt: skip


def level(value: float, name: str, colour: str, dash: spec.Dash) -> spec.Rule:
    return spec.Rule(at=value, name=name, colour=colour, dash=dash, width=1.1, hover="%{y:.4g}")


def changes(
    called: Sequence[CalledChange], times: Sequence[datetime], with_words: bool = True
) -> list[spec.Span]:
    """Return spans of when each detected change began, the words of later ones a line lower."""
    first, last = min(times), max(times)
    thin, middle = _THINNEST * (last - first), first + (last - first) / 2
    return [
        spec.Span(
            low=min(change.began_after, change.began_by - thin), high=change.began_by,
            colour="purple", opacity=0.25, name="change began", label_line=line,
            label=change.words if with_words else "",
            label_side="left" if change.began_by < middle else "right",
        )
        for line, change in enumerate(sorted(called, key=lambda each: each.began_by))
    ]  # fmt: skip


def time_axis(times: Sequence[datetime]) -> spec.Axis:
    """Return all tests with a little room, at least a day either side."""
    first, last = min(times), max(times)
    margin = max(_MARGIN * (last - first), _LEAST_MARGIN)
    return spec.Axis(label=TIME, scale="date", range=(first - margin, last + margin))


def inner(values: FloatArray) -> FloatArray:
    """Return the known values, with outliers drawn closer to the rest.

    For the limits of an axis: (n,) of any unit to (m,), m <= n.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return known
    lower, middle, upper = np.quantile(known, [0.1, 0.5, 0.9])
    reach = _REACH * max(upper - middle, middle - lower)
    return np.asarray(np.clip(known, middle - reach, middle + reach))
