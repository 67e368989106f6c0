"""States over time: what each test says, what is known of tension and springs, what was called."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report.content import HangerReport
from shm.report.figures import style, timeline
from shm.report.figures.member import Member
from shm.report.states import CalledChange, QuantityOverTime, StatesOverTime
from shm.values import BoolArray, FloatArray
from shm.values.force_units import force_unit
from shm.watch.history import Band

_TENSION_INCHES, _STIFFNESS_INCHES, _TEMPERATURE_INCHES = 2.3, 1.5, 0.75
_REST_INCHES = 0.9
_MARGIN = 0.08
_THINNEST = 0.004
_LEAST_TESTS = 2
"""One test alone has no course: its numbers stand elsewhere."""


def _draw(data: StatesOverTime) -> Figure | None:
    if not data.times or not data.quantities:
        return None
    warm = bool(np.any(np.isfinite(data.temperatures_c)))
    heights = [_inches(quantity) for quantity in data.quantities] + [_TEMPERATURE_INCHES] * warm
    figure = style.new_figure(sum(heights) + _REST_INCHES)
    panels = style.stacked(figure, heights)
    for axes, quantity in zip(panels, data.quantities, strict=False):
        _panel(axes, data, quantity)
    if warm:
        _temperature(panels[-1], data)
    for axes in panels[:-1]:
        axes.tick_params(axis="x", labelbottom=False)
    panels[-1].set_xlabel("time of the test (UTC)", fontsize=9, color=style.INK)
    timeline.dress_time(panels[-1], data.times)
    for axes in panels[: len(data.quantities)]:
        _spans(axes, data.changes)
    _words(panels[0], data.changes)
    figure.align_ylabels(panels)
    style.legend_of_figure(figure, panels, columns=5)
    return figure


def _inches(quantity: QuantityOverTime) -> float:
    return _TENSION_INCHES if quantity.is_tension else _STIFFNESS_INCHES


def _panel(axes: Axes, data: StatesOverTime, quantity: QuantityOverTime) -> None:
    scale, unit = _scale(quantity)
    style.dress(axes, "", f"tension ({unit})" if quantity.is_tension else f"log10 of\n{unit}")
    if not quantity.is_tension:
        axes.set_title(quantity.title, fontsize=9, color=style.INK, loc="left", pad=3)
    times = timeline.positions(data.times)
    _states(axes, times, quantity, scale)
    _readings(axes, times, quantity.read, data.outlier, scale)
    _see(axes, quantity, data.outlier, scale)
    _out_of_view(axes, times, quantity.read.middle * scale)
    _levels(axes, quantity, scale)


def _scale(quantity: QuantityOverTime) -> tuple[float, str]:
    """What turns its values into those of its axis, and their unit: that of a tension fits it."""
    if not quantity.is_tension:
        return 1.0, quantity.unit
    unit = force_unit(quantity.baseline, *quantity.filtered.middle.tolist())
    return 1 / unit.newtons, unit.name


def _states(axes: Axes, times: FloatArray, quantity: QuantityOverTime, scale: float) -> None:
    filtered, smoothed = quantity.filtered, quantity.smoothed
    axes.fill_between(
        times,
        filtered.low * scale,
        filtered.high * scale,
        color=style.BLUE,
        alpha=0.22,
        linewidth=0,
        label="90 % band",
    )
    axes.plot(
        times, filtered.middle * scale, color=style.BLUE, linewidth=1.5, zorder=3, label="filtered"
    )
    axes.plot(
        times,
        smoothed.middle * scale,
        color=style.ORANGE,
        linewidth=1.4,
        linestyle=(0, (4, 2.5)),
        zorder=3.1,
        label="smoothed",
    )


def _readings(axes: Axes, times: FloatArray, read: Band, outlier: BoolArray, scale: float) -> None:
    known = np.isfinite(read.middle)
    for chosen, face, label in (
        (known & ~outlier, style.QUIET, "test by itself"),
        (known & outlier, "white", "taken as outlier"),
    ):
        if not np.any(chosen):
            continue
        below, above = read.middle - read.low, read.high - read.middle
        axes.errorbar(
            times[chosen],
            read.middle[chosen] * scale,
            yerr=np.array([below[chosen], above[chosen]]) * scale,
            linestyle="none",
            marker="o",
            markersize=2.8 if face != "white" else 4.2,
            color=style.QUIET,
            markerfacecolor=face,
            markeredgewidth=0.9,
            elinewidth=0.6,
            alpha=0.7,
            zorder=2,
            label=label,
        )


def _see(axes: Axes, quantity: QuantityOverTime, outlier: BoolArray, scale: float) -> None:
    """Shows states, baseline and thresholds; lone readings and wide bands may lie beyond."""
    shown = np.concatenate(
        [
            quantity.filtered.middle,
            quantity.smoothed.middle,
            timeline.inner(quantity.filtered.low),
            timeline.inner(quantity.filtered.high),
            timeline.inner(quantity.read.middle[~outlier]),
            [quantity.baseline, quantity.lower_threshold, quantity.upper_threshold],
        ]
    )
    low, high = np.nanmin(shown), np.nanmax(shown)
    margin = _MARGIN * max(high - low, 1e-3 * abs(high))
    axes.set_ylim((low - margin) * scale, (high + margin) * scale)


def _out_of_view(axes: Axes, times: FloatArray, values: FloatArray) -> None:
    """Triangles at the edges beyond which single tests lie."""
    low, high = axes.get_ylim()
    for beyond, edge, marker in ((values > high, high, "^"), (values < low, low, "v")):
        if np.any(beyond):
            axes.plot(
                times[beyond],
                np.full(beyond.sum(), edge),
                linestyle="none",
                marker=marker,
                markersize=5,
                markerfacecolor="white",
                markeredgecolor=style.QUIET,
                clip_on=False,
                zorder=4,
                label="test out of view",
            )


def _levels(axes: Axes, quantity: QuantityOverTime, scale: float) -> None:
    axes.axhline(
        quantity.baseline * scale,
        color=style.GREEN,
        linestyle="--",
        linewidth=1.2,
        label="baseline",
    )
    for limit in (quantity.lower_threshold * scale, quantity.upper_threshold * scale):
        if np.isfinite(limit):
            axes.axhline(limit, color=style.RED, linestyle="-.", linewidth=1.1, label="threshold")


def _spans(axes: Axes, changes: Sequence[CalledChange]) -> None:
    left, right = axes.get_xlim()
    for change in changes:
        after, by = timeline.positions([change.began_after, change.began_by])
        thin = _THINNEST * (right - left)
        axes.axvspan(
            min(after, by - thin),
            by,
            facecolor=style.PURPLE,
            alpha=0.3,
            linewidth=0,
            zorder=0.5,
            label="change began",
        )


def _words(axes: Axes, changes: Sequence[CalledChange]) -> None:
    """A few words over each called change, those of later ones a line higher if they are near."""
    left, right = axes.get_xlim()
    written, ends = 0, -np.inf
    for change in sorted(changes, key=lambda each: each.began_by):
        middle = timeline.positions([change.began_after, change.began_by]).mean()
        place = (middle - left) / (right - left)
        half = 0.0075 * len(change.words)
        place = min(max(place, half), 1 - half)
        written = written + 1 if place - half < ends else 0
        ends = place + half
        axes.annotate(
            change.words,
            (place, 1.0),
            xycoords="axes fraction",
            xytext=(0, 2 + 10 * written),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=style.TINY + 0.5,
            color=style.PURPLE,
        )


def _temperature(axes: Axes, data: StatesOverTime) -> None:
    style.dress(axes, "", "temp.\n(°C)")
    known = np.isfinite(data.temperatures_c)
    times = timeline.positions(data.times)
    axes.plot(
        times[known],
        data.temperatures_c[known],
        color=style.QUIET,
        linewidth=0.8,
        marker=".",
        markersize=3,
    )
    if np.isfinite(data.reference_temperature_c):
        axes.axhline(data.reference_temperature_c, color=style.GREEN, linestyle="--", linewidth=1)


def _caption(data: StatesOverTime) -> str:
    at = (
        f", at {data.reference_temperature_c:.1f} °C"
        if np.isfinite(data.reference_temperature_c)
        else ""
    )
    return (
        f"Tension and stiffness over time{at}: the swing with the temperature is taken out. Dots: "
        "what each test says by itself with its own 90 % interval, hollow where it was taken as an "
        "outlier, triangles where it lies out of view. Solid: the state from the tests up to each, "
        "with its 90 % band; dashed orange: from all tests. Dashed green: baseline; dash-dotted: "
        "thresholds. Upright spans: when a called change began, with 90 % probability. At the "
        "bottom: temperature of the tests."
    )


def _alt(data: StatesOverTime) -> str:
    last = [_last(quantity) for quantity in data.quantities]
    called = [f"{change.words}, begun by {change.began_by:%Y-%m-%d}" for change in data.changes]
    return (
        f"States over {len(data.times)} tests, at last: {'; '.join(last)}. "
        f"Changes called: {'; '.join(called) or 'none'}."
    )


def _last(quantity: QuantityOverTime) -> str:
    band = quantity.filtered
    scale, name = _scale(quantity)
    unit = f" {name}" if quantity.is_tension else ""
    low, middle, high = (float(part[-1]) * scale for part in (band.low, band.middle, band.high))
    return (
        f"{quantity.title} {middle:.4g}{unit} (90 % interval {low:.4g} to {high:.4g}{unit}), "
        f"baseline {quantity.baseline * scale:.4g}{unit}"
    )


def _draw_course(data: StatesOverTime) -> Figure | None:
    return _draw(data) if len(data.times) >= _LEAST_TESTS else None


STATES = Member("drift", "States over time", _draw, _caption, _alt)
FIGURE = Member[HangerReport](
    STATES.name,
    STATES.title,
    lambda data: _draw_course(data.states.within(data.period)),
    lambda data: _caption(data.states.within(data.period)),
    lambda data: _alt(data.states.within(data.period)),
)
