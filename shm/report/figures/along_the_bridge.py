"""Along the bridge: who gained and who lost tension, and what each hanger carries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from shm.report import formatting
from shm.report.contents import BridgeReport, HangerLine
from shm.report.figures import style
from shm.report.figures.specification import Illustration, Member, drawn
from shm.report.formatting import Interval
from shm.report.hanger_status import Status
from shm.report.shifts import shift_unit
from shm.values import FloatArray
from shm.watch.neighbours import BridgePattern, HangerRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

Along = TypeVar("Along", float, FloatArray)

# Vermilion and blue differ in hue and lightness for every kind of colour blindness; the middle is a
# grey that still shows as a line.
_LOST_TO_GAINED = ("#8c3d00", style.ORANGE, "#c9ccd2", style.BLUE, "#003f63")
_RISE = 1.0
_DECK = 0.0
_CLEARANCE = 0.12
_LEAST_RANGE_PERCENT = 2.0
_MOST_NUMBERS = 24
_WIDTH_POINTS = 160.0
_INCHES = 5.0


def bridge_illustration(pattern: BridgePattern) -> Illustration:
    """The picture of a pattern, with its caption and its words for the blind."""
    (illustration,) = drawn((SHIFTS,), pattern)
    return illustration


def _draw_shifts(pattern: BridgePattern) -> Figure | None:
    # What draws is loaded where something is drawn.
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    figure = style.new_figure(_INCHES)
    above, below = style.stacked(figure, (1.0, 1.0))
    places = _places(pattern)
    widest = max(abs(100 * row.shift_fraction) for row in pattern.rows)
    limit = max(widest, _LEAST_RANGE_PERCENT)
    colours = LinearSegmentedColormap.from_list("lost to gained", _LOST_TO_GAINED)
    scale = ScalarMappable(Normalize(-limit, limit), colours)
    _elevation(above, pattern, places, scale)
    _bars(below, pattern, places, scale)
    _colour_bar(figure, [above, below], scale)
    return figure


def _places(pattern: BridgePattern) -> dict[int, float]:
    """Where each hanger stands along the bridge: in m where all are known, else by its place."""
    if not _in_metres(pattern):
        compared = {row.hanger: float(row.place) for row in pattern.rows}
        return compared | {each.hanger: float(each.place) for each in pattern.not_compared}
    known = {row.hanger: row.position_m for row in pattern.rows}
    at = np.array([[row.place, row.position_m] for row in pattern.rows])
    slope, start = np.polyfit(at[:, 0], at[:, 1], 1)
    between = {each.hanger: start + slope * each.place for each in pattern.not_compared}
    return {**known, **between}


def _in_metres(pattern: BridgePattern) -> bool:
    return all(math.isfinite(row.position_m) for row in pattern.rows)


def _colours(rows: Sequence[HangerRow], scale: ScalarMappable) -> list[tuple[float, ...]]:
    shifts = np.array([100 * row.shift_fraction for row in rows])
    return [tuple(each) for each in scale.to_rgba(shifts)]


def _ends(places: dict[int, float]) -> tuple[float, float]:
    """Where the arch meets the deck: a place beyond the last hangers."""
    first, last = min(places.values()), max(places.values())
    return first - _step(places), last + _step(places)


def _step(places: dict[int, float]) -> float:
    return (max(places.values()) - min(places.values())) / max(len(places) - 1, 1)


def _elevation(
    axes: Axes, pattern: BridgePattern, places: dict[int, float], scale: ScalarMappable
) -> None:
    ends = _ends(places)
    along = np.linspace(*ends, 200)
    style_of = {"color": style.INK, "solid_capstyle": "round", "zorder": 4}
    axes.plot(along, _arch(along, ends), linewidth=3.0, **style_of)  # type: ignore[arg-type]
    axes.plot(ends, (_DECK, _DECK), linewidth=4.5, **style_of)  # type: ignore[arg-type]
    width = min(4.0, _WIDTH_POINTS / len(places))
    for row, colour in zip(pattern.rows, _colours(pattern.rows, scale), strict=True):
        at = places[row.hanger]
        top = _arch(at, ends)
        axes.plot((at, at), (_DECK, top), color=colour, linewidth=width, solid_capstyle="butt")
    for each in pattern.not_compared:
        at = places[each.hanger]
        top = _arch(at, ends)
        axes.plot((at, at), (_DECK, top), color=style.QUIET, linewidth=1.0, linestyle=":")
    _numbers(axes, pattern, places)
    axes.set_ylim(-0.25, _RISE * 1.06)
    axes.set_axis_off()


def _arch(along: Along, ends: tuple[float, float]) -> Along:
    """Height of a parabola that stands on the deck's ends."""
    across = (2 * along - ends[0] - ends[1]) / (ends[1] - ends[0])
    return _RISE * (1 - across**2)


def _numbers(axes: Axes, pattern: BridgePattern, places: dict[int, float]) -> None:
    compared = {row.hanger for row in pattern.rows}
    marked = _marked(pattern)
    for hanger in _with_room([*marked, *sorted(places, key=lambda each: places[each])], places):
        axes.text(
            places[hanger], -_CLEARANCE, str(hanger),
            ha="center", va="center", fontsize=style.TINY + 1,
            color=style.INK if hanger in compared else style.QUIET,
            fontweight="bold" if hanger in marked else "normal",
        )  # fmt: skip


def _marked(pattern: BridgePattern) -> list[int]:
    """Those who moved, the furthest first; none where most did, for then none stands out."""
    moved = [row for row in pattern.rows if row.way != "unchanged"]
    if len(moved) > len(pattern.rows) / 2:
        return []
    return [row.hanger for row in sorted(moved, key=lambda row: -abs(row.shift_n))]


def _with_room(hangers: Sequence[int], places: dict[int, float]) -> list[int]:
    """As many of `hangers`, the first before the others, as have room for their numbers."""
    room = (max(places.values()) - min(places.values())) / _MOST_NUMBERS
    shown: list[int] = []
    for hanger in hangers:
        if all(abs(places[hanger] - places[each]) >= room for each in shown):
            shown.append(hanger)
    return shown


def _bars(
    axes: Axes, pattern: BridgePattern, places: dict[int, float], scale: ScalarMappable
) -> None:
    metres = _in_metres(pattern)
    unit, _ = shift_unit(pattern)
    along = "along the bridge (m)" if metres else "hanger"
    style.dress(axes, along, f"lost or gained ({unit.name})")
    axes.grid(False, axis="x")
    rows = pattern.rows
    at = np.array([places[row.hanger] for row in rows])
    shifts = unit.of(np.array([row.shift_n for row in rows]))
    half = unit.of(np.array([row.high_n - row.shift_n for row in rows]))
    axes.bar(at, shifts, 0.62 * _step(places), color=_colours(rows, scale), zorder=2)
    axes.errorbar(
        at, shifts, half,
        fmt="none", ecolor=style.INK, elinewidth=1.1, zorder=3,
        capsize=2.5 if len(rows) <= _MOST_NUMBERS else 0,
    )  # fmt: skip
    axes.axhline(0, color=style.INK, linewidth=0.9)
    axes.set_xlim(*_ends(places))
    if not metres:
        shown = _with_room(sorted(places, key=lambda hanger: places[hanger]), places)
        axes.set_xticks([places[hanger] for hanger in shown], [str(hanger) for hanger in shown])


def _colour_bar(figure: Figure, panels: Sequence[Axes], scale: ScalarMappable) -> None:
    bar = figure.colorbar(scale, ax=list(panels), fraction=0.03, pad=0.02, aspect=34)
    bar.set_label("shift of the tension (%)", fontsize=9.0, color=style.INK)
    bar.ax.tick_params(labelsize=9.0, colors=style.INK)
    bar.outline.set_visible(False)


def _caption_of_shifts(pattern: BridgePattern) -> str:
    unit, _ = shift_unit(pattern)
    dotted = " Dotted: not compared, no recent test." if pattern.not_compared else ""
    return (
        "Above: the hangers between deck and arch (not to scale), coloured by the shift of their "
        "tension from the baseline: orange lost, blue gained, grey neither. Only bold numbers "
        f"have likelier moved than not.{dotted} Below: the same in {unit.name}, with 90 % "
        f"intervals. {pattern.sentence}"
    )


def _alt_of_shifts(pattern: BridgePattern) -> str:
    unit, places = shift_unit(pattern)
    moved = [
        f"hanger {row.hanger} {unit.of(row.shift_n):+z.{places - 1}f} {unit.name} "
        f"({100 * row.shift_fraction:+z.1f} %)"
        for row in pattern.rows
        if row.way != "unchanged"
    ]
    told = formatting.listed(moved) if moved else "none moved"
    return f"Shifts of the tension of {len(pattern.rows)} hangers along the bridge: {told}."


SHIFTS = Member(
    "bridge_shift", "Shifts along the bridge", _draw_shifts, _caption_of_shifts, _alt_of_shifts
)


_MARKS = {
    Status.ALERT: (style.RED, "v"),
    Status.WATCH: (style.ORANGE, "D"),
    Status.CHECK: (style.ORANGE, "X"),
    Status.UNCLEAR: (style.ORANGE, "P"),
    Status.STEADY: (style.GREEN, "o"),
    Status.FIRST: (style.BLUE, "s"),
}
_MOST_TICKS = 40
_VIEW_PERCENT = 25.0
"""How far beyond the means the figure reaches at most, so that a wide interval hides none."""


def _draw_tensions(data: BridgeReport) -> Figure | None:
    shares = _shares(data)
    if not shares:
        return None
    figure, axes = style.one_panel(
        "hanger, in the order of the bridge", "tension (% of nominal)", 3.2
    )
    axes.grid(False, axis="x")
    axes.axhline(100, color=style.INK, linestyle=":", label="nominal")
    for status in Status:
        _points(axes, [each for each in shares if each[1].status is status], status)
    _view(axes, [share for *_, share in shares])
    _hanger_numbers(axes, data)
    style.legend_above(axes, columns=5)
    return figure


def _shares(data: BridgeReport) -> list[tuple[int, HangerLine, Interval]]:
    """Place, line and percent of nominal of the hangers that have a tension and a nominal one."""
    return [
        (place, line, share)
        for place, line in enumerate(data.hangers)
        if (share := line.of_nominal) is not None
    ]


def _points(axes: Axes, shares: list[tuple[int, HangerLine, Interval]], status: Status) -> None:
    if not shares:
        return
    colour, marker = _MARKS[status]
    places = [place for place, *_ in shares]
    means = np.array([share.mean for *_, share in shares])
    bounds = np.array([[share.low, share.high] for *_, share in shares]).T
    axes.vlines(places, *bounds, color=colour, linewidth=1.3)
    axes.plot(
        places, means, linestyle="none", marker=marker, markersize=5.5, color=colour,
        label=status.value.lower(),
    )  # fmt: skip


def _view(axes: Axes, shares: list[Interval]) -> None:
    means = [share.mean for share in shares] + [100.0]
    low = max(min(share.low for share in shares), min(means) - _VIEW_PERCENT)
    high = min(max(share.high for share in shares), max(means) + _VIEW_PERCENT)
    low, high = min(low, *means), max(high, *means)
    margin = 0.06 * (high - low) + 0.5
    axes.set_ylim(low - margin, high + margin)


def _hanger_numbers(axes: Axes, data: BridgeReport) -> None:
    step = 1 + (len(data.hangers) - 1) // _MOST_TICKS
    places = range(0, len(data.hangers), step)
    axes.set_xticks(list(places), [str(data.hangers[place].hanger.id) for place in places])
    axes.set_xlim(-0.8, len(data.hangers) - 0.2)


def _caption_of_tensions(data: BridgeReport) -> str:
    missing = len(data.hangers) - len(_shares(data))
    left_out = f" {formatting.counted(missing, 'hanger')} without a tension." if missing else ""
    return (
        "Tension of each hanger by its latest test, in percent of its nominal tension: mean and "
        "90 % interval, which may reach beyond the view; its state by mark and colour. Dotted: "
        f"nominal.{left_out}"
    )


def _alt_of_tensions(data: BridgeReport) -> str:
    told = [f"{line.hanger.id} {share.mean:.0f} %" for _, line, share in _shares(data)]
    return f"Tension over nominal of {formatting.counted(len(told), 'hanger')}: {', '.join(told)}."


TENSIONS = Member(
    "bridge_tension",
    "Tension of the hangers",
    _draw_tensions,
    _caption_of_tensions,
    _alt_of_tensions,
)
