"""What is drawn over time: bands, single tests with their intervals, levels, fewer points."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from shm.report.sheet.thinning import envelope_places
from shm.store import TrendPoint
from shm.values import FloatArray, IntArray, Summary
from shm.values.force_units import ForceUnit, force_unit
from shm.watch.history import Band
from shm_daemon.web.plotting import colour

Trace = Mapping[str, Any]
MOST_POINTS = 1_000
"""Of which a figure is thinned: a hanger with a test a day for three years is drawn whole."""
_BINS = MOST_POINTS // 6
_ROOM = 0.08


def places(*curves: FloatArray, always: Collection[int] = ()) -> IntArray:
    """Indices (m,) of what to draw of curves (n,): of each bin the extremes of every curve.

    The first, the last and those of `always` stay whatever they are.
    """
    count = len(curves[0])
    if count <= MOST_POINTS:
        return np.arange(count)
    chosen = [envelope_places(curve, _BINS) for curve in curves]
    kept = np.array(sorted({0, count - 1, *always}), dtype=np.int64)
    return np.unique(np.concatenate([*chosen, kept]))


def thinned_words(count: int) -> str:
    """What a caption says, after a space, of a figure of so many tests that shows only some."""
    if count <= MOST_POINTS:
        return ""
    return f" Of {count} tests those are drawn that keep every extreme; enlarging brings no more."


def tests_at(points: Sequence[TrendPoint], named: Collection[str]) -> list[int]:
    """The places of the tests with these names."""
    return [place for place, point in enumerate(points) if point.test in named]


def band_of(summaries: Sequence[Summary | None]) -> Band:
    """Means with their 90 % intervals, NaN where there is none."""
    rows = np.array(
        [(s.q05, s.mean, s.q95) if s else (np.nan,) * 3 for s in summaries], dtype=np.float64
    ).reshape(-1, 3)
    return Band(*rows.T)


def tension_unit(points: Sequence[TrendPoint]) -> ForceUnit:
    """The one unit of the tensions of a hanger's tests."""
    return force_unit(*(point.tension_n.mean for point in points))


def in_unit(band: Band, unit: ForceUnit) -> Band:
    """A band of forces in N in another unit."""
    return Band(unit.of(band.low), unit.of(band.middle), unit.of(band.high))


def band_traces(
    times: Sequence[datetime], band: Band, name: str, hue: str, **more: Any
) -> list[Trace]:
    """A line and its band; the band stands in the legend with its line."""
    clock = stamps(times)
    edge = {
        "type": "scatter", "x": clock, "mode": "lines", "line": {"width": 0},
        "hoverinfo": "skip", "showlegend": False, "legendgroup": name, **more,
    }  # fmt: skip
    return [
        {**edge, "y": band.low},
        {**edge, "y": band.high, "fill": "tonexty", "fillcolor": colour(hue, 0.2)},
        {
            "type": "scatter", "x": clock, "y": band.middle, "mode": "lines", "name": name,
            "legendgroup": name, "line": {"color": colour(hue), "width": 2},
            "customdata": np.column_stack([band.low, band.high]),
            "hovertemplate": "%{y:.4g} (90 %: %{customdata[0]:.4g} to %{customdata[1]:.4g})",
            **more,
        },
    ]  # fmt: skip


def dots_trace(
    times: Sequence[datetime],
    band: Band,
    names: Sequence[str],
    label: str,
    hue: str = "quiet",
    **more: Any,
) -> Trace:
    """Single tests as marks with their 90 % intervals."""
    return {
        "type": "scatter", "x": stamps(times), "y": band.middle, "mode": "markers", "name": label,
        "marker": {"color": colour(hue), "size": 6},
        "error_y": {
            "type": "data", "symmetric": False, "array": band.high - band.middle,
            "arrayminus": band.middle - band.low, "color": colour(hue, 0.55), "thickness": 1.2,
            "width": 0,
        },
        "text": list(names),
        "customdata": np.column_stack([band.low, band.high]),
        "hovertemplate": "%{text}: %{y:.4g} (90 %: %{customdata[0]:.4g} to "
        "%{customdata[1]:.4g})<extra></extra>",
        **more,
    }  # fmt: skip


def level_trace(
    times: Sequence[datetime], value: float, name: str, hue: str, dash: str, **more: Any
) -> Trace:
    """A level from the first time to the last."""
    return {
        "type": "scatter", "x": stamps([times[0], times[-1]]), "y": [value, value],
        "mode": "lines", "name": name, "line": {"color": colour(hue), "dash": dash, "width": 1.5},
        "hovertemplate": "%{y:.4g}", **more,
    }  # fmt: skip


def limits(values: FloatArray) -> list[float]:
    """An axis that shows all known values, with a little room."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = _ROOM * max(high - low, 1e-3 * abs(high))
    return [low - margin, high + margin]


def stamps(times: Sequence[datetime]) -> list[str]:
    """As plotly takes them: in UTC, without the zone, which it would ignore."""
    return [f"{time.astimezone(UTC):%Y-%m-%d %H:%M:%S}" for time in times]


def picked(times: Sequence[datetime], chosen: IntArray) -> list[datetime]:
    return [times[place] for place in chosen.tolist()]


def of(band: Band, chosen: IntArray) -> Band:
    return Band(band.low[chosen], band.middle[chosen], band.high[chosen])
