"""Draw force and accelerations over the complete test, every hit marked."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.values import Channel, FloatArray, Recording

if TYPE_CHECKING:
    from shm.identify import Hit

# Layout: numbers of hits, channels drawn, bins of a curve; shares of the axis before the first
# record, with which a hit may begin, and between two; where the marks of hits stand in the
# uppermost panel, and the room above its curve.
_MOST_NUMBERS, _MOST_CHANNELS, _BINS = 40, 4, 700
_LEAD, _GAP_SHARE = 0.012, 0.015
_MARKS_AT, _ROOM = 0.84, 0.35


def shown_rows(sheet: ModalTestReport) -> list[int]:
    """Return rows of accelerations to draw: half of them channels left out, where there are any."""
    channels, faults = sheet.recordings[0].accelerations, sheet.channel_faults
    rows = range(len(channels))
    faulty = [row for row in rows if channels[row].name in faults][: _MOST_CHANNELS // 2]
    sound = [row for row in rows if channels[row].name not in faults]
    return sorted((faulty + sound)[:_MOST_CHANNELS])


def _offsets_s(sheet: ModalTestReport) -> list[float]:
    """Return where each record begins on the common axis, and where the last ends, in s."""
    durations = [record.duration_s for record in sheet.recordings]
    gap = _GAP_SHARE * sum(durations) if len(durations) > 1 else 0.0
    ends = np.cumsum([each + gap for each in durations])
    return [0.0, *ends[:-1].tolist(), float(ends[-1]) - gap]


def _hit_time_s(sheet: ModalTestReport, hit: Hit) -> float:
    return _offsets_s(sheet)[hit.record] + hit.start_s


def _channel(record: Recording, row: int | None) -> Channel | None:
    """Return the force (`row` None) or the acceleration of that row; None where it has none."""
    if row is None:
        return record.force
    return record.accelerations[row] if row < len(record.accelerations) else None


def _joined(sheet: ModalTestReport, row: int | None) -> tuple[FloatArray, FloatArray]:
    """Return time in s and values of one channel over all records, one after the other.

    Infinite between the records: a line breaks there, and no sample is missing.
    """
    times, values = [np.empty(0)], [np.empty(0)]
    for offset, record in zip(_offsets_s(sheet), sheet.recordings, strict=False):
        if (channel := _channel(record, row)) is not None:
            at = offset + np.arange(record.samples + 1) / record.sampling_rate_hz
            times.append(at)
            values.append(np.append(channel.values, np.inf))
    return np.concatenate(times), np.concatenate(values)


def _draw(shown: ResponseCurves) -> spec.Specification | None:
    sheet, records = shown.sheet, shown.sheet.recordings
    if not records or not records[0].accelerations:
        return None
    rows: list[int | None] = list(shown_rows(sheet))
    if records[0].force is not None:
        rows = [None, *rows]
    panels = [_history(sheet, row, is_top=place == 0) for place, row in enumerate(rows)]
    end_s = _offsets_s(sheet)[-1]
    several = "" if len(records) == 1 else ", the records one after the other"
    across = spec.Axis(label=f"time{several} (s)", range=(-_LEAD * end_s, end_s))
    panels[-1] = replace(panels[-1], x=across)
    return spec.stacked(panels, sum(panel.height for panel in panels) + 0.9, 3)


def _history(sheet: ModalTestReport, row: int | None, is_top: bool) -> spec.Panel:
    channel = _channel(sheet.recordings[0], row)
    assert channel is not None
    at_s, joined = _joined(sheet, row)
    values = np.where(np.isfinite(joined), joined, np.nan)
    places = spec.envelope_places(values, _BINS)
    time_s, values = at_s[places], values[places]
    unknown = np.flatnonzero(np.isnan(joined))
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
    if len(unknown):
        width = max(1, len(joined) // _BINS)
        shown = at_s[np.unique(unknown // width) * width]
        marks.append(
            spec.Points(
                x=shown, y=np.full(len(shown), 0.04), in_shares=True, symbol="tick", size=5,
                colour="red", name="not a number", hover="%{x:.3f} s",
            )
        )  # fmt: skip
    marks += [
        spec.Rule(at=start_s, axis="x", colour="quiet", width=0.8, dash="dot")
        for start_s in _offsets_s(sheet)[1:-1]
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
    channels = [_channel(record, row) for record in sheet.recordings]
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
            at=_hit_time_s(sheet, hit), axis="x", colour="green" if hit.used else "red", width=0.7,
            opacity=0.7, dash="solid" if hit.used else "dash",
        )
        for _, hit in sheet.located_hits
    ]  # fmt: skip


def _hit_marks(sheet: ModalTestReport) -> list[spec.Mark]:
    """Return numbered symbols for used hits in one row, and a row for each reason to drop."""
    located = sheet.located_hits
    groups: dict[str, list[tuple[int, Hit]]] = {}
    for number, hit in located:
        groups.setdefault("" if hit.used else hit.reason, []).append((number, hit))
    found: list[spec.Mark] = []
    for reason, hits in groups.items():
        counted = formatting.counted(len(hits), "hit")
        found.append(
            spec.Points(
                x=[_hit_time_s(sheet, hit) for _, hit in hits], y=[_MARKS_AT] * len(hits),
                in_shares=True, symbol="cross" if reason else "triangle down", size=5,
                colour="red" if reason else "green",
                name=f"{counted} dropped: {reason}" if reason else f"{counted} used",
                labels=[str(number) for number, _ in hits] if len(located) <= _MOST_NUMBERS else (),
                label_side="top",
                texts=[_wording(number, hit, _hit_time_s(sheet, hit)) for number, hit in hits],
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
        for number, hit in sheet.located_hits
        if not hit.used
    ]
    left = f"; dropped: {', '.join(dropped)}" if dropped else ""
    return f"The signals of {seconds:.3g} s of records; {used} used{left}."


FIGURE = spec.FigureSpec("time_history", "Time histories with the hits", _draw, _caption, _alt)
