"""Force and accelerations over the whole test, every hit marked; below, one hit from near."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from shm.identify import Hit
from shm.report import words
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.sheet.blows import Blow, blows
from shm.report.sheet.channels import shown_rows, strongest_row
from shm.report.sheet.content import TestSheet
from shm.report.sheet.thinning import envelope_places
from shm.report.sheet.timeline import (
    borders_s,
    channel_of,
    hit_time_s,
    located_hits,
    offsets_s,
    thinned,
    unknown_times_s,
)
from shm.values import FloatArray, Recording

_MOST_CHANNELS = 4
_MOST_NUMBERS = 40
_ZOOM_INCHES = 1.9
_MOTION_NEAR_S = (-0.05, 0.3)
_LEAD = 0.012
"""Room before the first record, as a share of all: a hit may begin with it."""
_NEAR_BINS = 300
_MOST_DOTS = 150


def _draw(sheet: TestSheet) -> Figure | None:
    records = sheet.recordings
    if not records or not records[0].accelerations:
        return None
    rows: list[int | None] = list(shown_rows(sheet, _MOST_CHANNELS))
    if records[0].force is not None:
        rows = [None, *rows]
    near = _typical(sheet)
    heights = [1.25 if row is None else 0.95 for row in rows]
    figure = style.new_figure(sum(heights) + 0.9 + (_ZOOM_INCHES if near else 0))
    upper, lower = _halves(figure, sum(heights) + 0.7) if near else (figure, None)
    panels = style.stacked(upper, heights)
    for axes, row in zip(panels, rows, strict=True):
        _history(axes, sheet, row)
    _hits(panels, sheet)
    style.legend_of_figure(upper, panels, columns=3)
    style.dress(panels[-1], _time_label(records), panels[-1].get_ylabel())
    if near and lower is not None:
        _near(lower.subplots(1, 2), sheet, near)
    return figure


def _halves(figure: Figure, upper_inches: float) -> tuple[FigureBase, FigureBase]:
    halves = figure.subfigures(2, 1, height_ratios=(upper_inches, _ZOOM_INCHES), squeeze=False)
    for half in halves[:, 0]:
        half.set_facecolor("none")
    return halves[0, 0], halves[1, 0]


def _time_label(records: tuple[Recording, ...]) -> str:
    return "time (s)" if len(records) == 1 else "time, the records one after the other (s)"


def _history(axes: Axes, sheet: TestSheet, row: int | None) -> None:
    records = sheet.recordings
    channel = channel_of(records[0], row)
    assert channel is not None
    style.dress(axes, "", "force (N)" if row is None else "m/s²")
    time_s, values = thinned(records, row)
    colour = style.INK if row is None else style.PURPLE
    if channel.plane and row is not None:
        colour = style.PLANE_COLOURS[channel.plane]
    axes.plot(time_s, values, color=colour, linewidth=0.6)
    end_s = offsets_s(records)[-1] + records[-1].duration_s
    axes.set_xlim(-_LEAD * end_s, end_s)
    _full_scale(axes, channel.full_scale, values)
    _unknown(axes, unknown_times_s(records, row))
    for border in borders_s(records):
        axes.axvline(border, color=style.QUIET, linewidth=0.8, linestyle=":")
    _entitle(axes, sheet, row)


def _entitle(axes: Axes, sheet: TestSheet, row: int | None) -> None:
    """Name, plane and place, and in red why the channel was left out."""
    channels = [channel_of(record, row) for record in sheet.recordings]
    first = channels[0]
    assert first is not None
    there = {c.x_m for c in channels if c is not None and np.isfinite(c.x_m)}
    title = words.place(first.name, first.plane, first.x_m if len(there) == 1 else np.nan)
    if len(there) > 1:
        title += ", place differs"
    fault = sheet.channel_faults.get(first.name)
    if fault:
        title += f", left out: {fault}"
    colour = style.RED if fault else style.INK
    axes.set_title(title, fontsize=style.TINY + 0.5, color=colour, loc="right", pad=2)


def _full_scale(axes: Axes, full_scale: float, values: FloatArray) -> None:
    """Lines at the largest value that can be recorded, where the signal comes near."""
    if np.nanmax(np.abs(values), initial=0.0) > 0.5 * full_scale:
        for level in (-full_scale, full_scale):
            axes.axhline(level, color=style.RED, linewidth=0.8, linestyle="--")


def _unknown(axes: Axes, time_s: FloatArray) -> None:
    if len(time_s):
        axes.plot(
            time_s, np.full(len(time_s), 0.04), transform=axes.get_xaxis_transform(),
            linestyle="none", marker="|", markersize=5, color=style.RED, label="not a number",
        )  # fmt: skip


def _hits(panels: Sequence[Axes], sheet: TestSheet) -> None:
    """Every hit in every panel; numbers, symbols and reasons in the uppermost."""
    top, hits = panels[0], located_hits(sheet)
    low, high = top.get_ylim()
    top.set_ylim(low, high + 0.35 * (high - low))
    groups: dict[str, list[float]] = {}
    for number, hit in hits:
        time_s = hit_time_s(sheet, hit)
        groups.setdefault("" if hit.used else hit.reason, []).append(time_s)
        if len(hits) <= _MOST_NUMBERS:
            _number(top, number, time_s, hit)
        for axes in panels[1:]:
            axes.axvline(
                time_s, color=style.GREEN if hit.used else style.RED, linewidth=0.7, alpha=0.7,
                linestyle="-" if hit.used else "--",
            )  # fmt: skip
    for reason, times_s in groups.items():
        _hit_marks(top, reason, times_s)


def _hit_marks(axes: Axes, reason: str, times_s: list[float]) -> None:
    marker, colour = ("X", style.RED) if reason else ("v", style.GREEN)
    hits = words.counted(len(times_s), "hit")
    label = f"{hits} dropped: {reason}" if reason else f"{hits} used"
    axes.plot(
        times_s,
        [0.84] * len(times_s),
        transform=axes.get_xaxis_transform(),
        linestyle="none",
        marker=marker,
        markersize=5,
        color=colour,
        label=label,
    )


def _number(axes: Axes, number: int, time_s: float, hit: Hit) -> None:
    axes.text(
        time_s,
        0.99,
        str(number),
        transform=axes.get_xaxis_transform(),
        ha="center",
        va="top",
        fontsize=style.TINY,
        color=style.GREEN if hit.used else style.RED,
    )


def _typical(sheet: TestSheet) -> Blow | None:
    """The used hit of median force, else any."""
    found = blows(sheet)
    hits = [blow for blow in found if blow.hit.used] or found
    hits = sorted(hits, key=lambda blow: blow.hit.peak_force_n)
    return hits[len(hits) // 2] if hits else None


def _near(panels: Sequence[Axes], sheet: TestSheet, near: Blow) -> None:
    record, start = sheet.recordings[near.hit.record], near.hit.start
    force, motion = record.force, channel_of(record, strongest_row(sheet))
    assert force is not None
    assert motion is not None
    rate = record.sampling_rate_hz
    label = f"time from the start of hit {near.number} (ms)"
    _zoom(panels[0], force.values, rate, start, near.near_s)
    style.dress(panels[0], label, "force (N)")
    _zoom(panels[1], motion.values, rate, start, _MOTION_NEAR_S)
    style.dress(panels[1], label, "m/s²")
    name = words.place(motion.name, motion.plane, motion.x_m)
    panels[1].set_title(name, fontsize=style.TINY + 0.5, color=style.INK, loc="right", pad=2)


def _zoom(
    axes: Axes, values: FloatArray, rate: float, start: int, span_s: tuple[float, float]
) -> None:
    first = max(0, start + int(span_s[0] * rate))
    part = values[first : start + int(span_s[1] * rate) + 2]
    places = envelope_places(part, _NEAR_BINS)
    time_ms = 1e3 * (first + places - start) / rate
    marker = "." if len(part) <= _MOST_DOTS else ""
    axes.plot(time_ms, part[places], color=style.INK, linewidth=0.8, marker=marker, markersize=3.5)
    axes.axvline(0, color=style.GREEN, linewidth=0.7)


def _caption(sheet: TestSheet) -> str:
    channels = len(sheet.recordings[0].accelerations)
    some = words.some(len(shown_rows(sheet, _MOST_CHANNELS)), channels, "accelerations")
    kind = "Force and accelerations" if sheet.recordings[0].force else "Accelerations"
    hits = (
        " Numbers and lines are the hits, in green those that were used, in red and dashed those "
        "that were dropped."
        if sheet.hits
        else ""
    )
    return (
        f"{kind} as recorded, drawn by the smallest and the largest value of each short span, so "
        f"that no peak is lost.{hits}{some}"
    )


def _alt(sheet: TestSheet) -> str:
    seconds = sum(record.duration_s for record in sheet.recordings)
    used = words.counted(len(sheet.used_hits), "hit")
    dropped = [
        f"hit {number} at {hit.start_s:.1f} s: {hit.reason}"
        for number, hit in located_hits(sheet)
        if not hit.used
    ]
    left = f"; dropped: {', '.join(dropped)}" if dropped else ""
    return f"The signals of {seconds:.3g} s of records; {used} used{left}."


FIGURE = Member("time_history", "Time histories with the hits", _draw, _caption, _alt)
