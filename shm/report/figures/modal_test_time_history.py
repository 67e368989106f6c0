"""Draw force and accelerations over the complete test, every hit marked."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.report.figures.modal_test_hits import (
    borders_s,
    channel_of,
    hit_time_s,
    located_hits,
    offsets_s,
    shown_rows,
    thinned,
    unknown_times_s,
)
from shm.report.figures.modal_test_response import ResponseCurves
from shm.values import FloatArray

if TYPE_CHECKING:
    from shm.identify import Hit

_MOST_NUMBERS = 40
_LEAD = 0.012
"""Room before the first record, as a share of all: a hit may begin with it."""
_MARKS_AT, _ROOM = 0.84, 0.35
"""Where the marks of the hits stand in the uppermost panel, as a share of its height, and the room
above the curve that is left to them, as a share of the curve's."""


def _draw(shown: ResponseCurves) -> spec.Specification | None:
    sheet, records = shown.sheet, shown.sheet.recordings
    if not records or not records[0].accelerations:
        return None
    rows: list[int | None] = list(shown_rows(sheet))
    if records[0].force is not None:
        rows = [None, *rows]
    panels = [_history(sheet, row, is_top=place == 0) for place, row in enumerate(rows)]
    end_s = offsets_s(records)[-1] + records[-1].duration_s
    several = "" if len(records) == 1 else ", the records one after the other"
    across = spec.Axis(label=f"time{several} (s)", range=(-_LEAD * end_s, end_s))
    panels[-1] = replace(panels[-1], x=across)
    return spec.stacked(panels, sum(panel.height for panel in panels) + 0.9, 3)


def _history(sheet: ModalTestReport, row: int | None, is_top: bool) -> spec.Panel:
    records, channel = sheet.recordings, channel_of(sheet.recordings[0], row)
    assert channel is not None
    time_s, values = thinned(records, row)
    colour = "ink" if row is None else spec.plane_colour(channel.plane)
    unit = "N" if row is None else "m/s²"
    marks: list[spec.Mark] = [
        spec.Line(
            x=time_s, y=values, colour=colour, width=0.6, hover=f"%{{x:.3f}} s: %{{y:.4g}} {unit}"
        )
    ]
    # The largest value that can be recorded, where the signal comes near.
    if np.nanmax(np.abs(values), initial=0.0) > 0.5 * channel.full_scale:
        ends = (-channel.full_scale, channel.full_scale)
        marks += [spec.Rule(at=end, colour="red", width=0.8, dash="dash") for end in ends]
    if len(unknown := unknown_times_s(records, row)):
        marks.append(
            spec.Points(
                x=unknown, y=np.full(len(unknown), 0.04), in_shares=True, symbol="tick", size=5,
                colour="red", name="not a number", hover="%{x:.3f} s",
            )
        )  # fmt: skip
    marks += [
        spec.Rule(at=at_s, axis="x", colour="quiet", width=0.8, dash="dot")
        for at_s in borders_s(records)
    ]
    marks += _hit_marks(sheet) if is_top else _hit_lines(sheet)
    title, title_colour = _title(sheet, row)
    label = "force (N)" if row is None else "m/s²"
    return spec.Panel(
        y=spec.Axis(label=label, range=_range(values, row, _ROOM if is_top else 0.0)), marks=marks,
        title=title, title_colour=title_colour, height=1.25 if row is None else 0.95,
    )  # fmt: skip


def _range(values: FloatArray, row: int | None, room: float) -> tuple[float, float]:
    """Return the values with a little room, and more above for marks."""
    largest = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
    low = float(np.nanmin(values)) if np.isfinite(values).any() else -1.0
    low, high = min(low, 0.0) - 0.05 * largest, 1.05 * largest
    return low, high + room * (high - low)


def _title(sheet: ModalTestReport, row: int | None) -> tuple[str, str]:
    """Name, plane and place, and in red why the channel was left out."""
    channels = [channel_of(record, row) for record in sheet.recordings]
    first = channels[0]
    assert first is not None
    there = {c.x_m for c in channels if c is not None and np.isfinite(c.x_m)}
    title = formatting.place(first.name, first.plane, first.x_m if len(there) == 1 else np.nan)
    if len(there) > 1:
        title += ", place differs"
    fault = sheet.channel_faults.get(first.name)
    return (f"{title}, left out: {fault}", "red") if fault else (title, "ink")


def _hit_lines(sheet: ModalTestReport) -> list[spec.Mark]:
    return [
        spec.Rule(
            at=hit_time_s(sheet, hit), axis="x", colour="green" if hit.used else "red", width=0.7,
            opacity=0.7, dash="solid" if hit.used else "dash",
        )
        for _, hit in located_hits(sheet)
    ]  # fmt: skip


def _hit_marks(sheet: ModalTestReport) -> list[spec.Mark]:
    """Return numbered symbols for used hits in one row, and a row for each reason to drop."""
    located = located_hits(sheet)
    groups: dict[str, list[tuple[int, Hit]]] = {}
    for number, hit in located:
        groups.setdefault("" if hit.used else hit.reason, []).append((number, hit))
    found: list[spec.Mark] = []
    for reason, hits in groups.items():
        counted = formatting.counted(len(hits), "hit")
        found.append(
            spec.Points(
                x=[hit_time_s(sheet, hit) for _, hit in hits], y=[_MARKS_AT] * len(hits),
                in_shares=True, symbol="cross" if reason else "triangle down", size=5,
                colour="red" if reason else "green",
                name=f"{counted} dropped: {reason}" if reason else f"{counted} used",
                labels=[str(number) for number, _ in hits] if len(located) <= _MOST_NUMBERS else (),
                label_side="top",
                texts=[_wording(number, hit, hit_time_s(sheet, hit)) for number, hit in hits],
            )
        )  # fmt: skip
    return found


def _wording(number: int, hit: Hit, at_s: float) -> str:
    """Describe a hit; `at_s` is on the axis, also where records follow each other."""
    what = "used" if hit.used else f"dropped: {hit.reason}"
    return f"hit {number}, {at_s:.3f} s, {formatting.plain(hit.peak_force_n, 4)} N, {what}"


def _caption(shown: ResponseCurves) -> str:
    sheet = shown.sheet
    channels = len(sheet.recordings[0].accelerations)
    some = formatting.some(len(shown_rows(sheet)), channels, "accelerations")
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


def _alt(shown: ResponseCurves) -> str:
    sheet = shown.sheet
    seconds = sum(record.duration_s for record in sheet.recordings)
    used = formatting.counted(len(sheet.used_hits), "hit")
    dropped = [
        f"hit {number} at {hit.start_s:.1f} s: {hit.reason}"
        for number, hit in located_hits(sheet)
        if not hit.used
    ]
    left = f"; dropped: {', '.join(dropped)}" if dropped else ""
    return f"The signals of {seconds:.3g} s of records; {used} used{left}."


FIGURE = spec.FigureSpec("time_history", "Time histories with the hits", _draw, _caption, _alt)
