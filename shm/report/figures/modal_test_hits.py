"""Draw the records of a test, what each hit left in them, and all hits superposed.

Superposed are pulse and force spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.report.figures.modal_test_response import ResponseCurves, searched_range
from shm.values import NAN, BoolArray, Channel, FloatArray, Recording

if TYPE_CHECKING:
    from shm.identify import Hit

# Layout: channels drawn, and of these at most that are not sound.
_MOST_CHANNELS, _MOST_FAULTY = 4, 2


def shown_rows(sheet: ModalTestReport) -> list[int]:
    """Return rows of accelerations to draw: some left out, then some of each plane in turn.

    Of a plane the first, the last, and those between.
    """
    channels = sheet.recordings[0].accelerations
    faults = sheet.channel_faults
    faulty = [row for row, channel in enumerate(channels) if channel.name in faults]
    sound = [row for row in range(len(channels)) if row not in faulty]
    chosen = faulty[:_MOST_FAULTY]
    chosen += _in_turn(channels, sound)[: max(1, _MOST_CHANNELS - len(chosen))]
    return sorted(chosen)


def _in_turn(channels: tuple[Channel, ...], rows: list[int]) -> list[int]:
    planes = list(dict.fromkeys(channels[row].plane for row in rows))
    queues = [_ends_first([r for r in rows if channels[r].plane == plane]) for plane in planes]
    longest = max((len(queue) for queue in queues), default=0)
    return [queue[turn] for turn in range(longest) for queue in queues if turn < len(queue)]


def _ends_first(rows: list[int]) -> list[int]:
    return [rows[0], *rows[:0:-1]] if rows else []


_BINS = 700
_GAP_SHARE = 0.015
"""Between two records, as a share of their whole length."""


def offsets_s(records: Sequence[Recording]) -> list[float]:
    """Return where each record begins on the common axis, in s."""
    whole = sum(record.duration_s for record in records)
    gap = _GAP_SHARE * whole if len(records) > 1 else 0.0
    ends = np.cumsum([record.duration_s + gap for record in records])
    return [0.0, *ends[:-1].tolist()]


def borders_s(records: Sequence[Recording]) -> list[float]:
    """Return the middle of the gap between each two records on the common axis, in s."""
    starts = offsets_s(records)
    ends = [start + record.duration_s for start, record in zip(starts, records, strict=True)]
    return [(end + start) / 2 for end, start in zip(ends[:-1], starts[1:], strict=True)]


def hit_time_s(sheet: ModalTestReport, hit: Hit) -> float:
    """Return the time of a hit on the common axis, in s."""
    return offsets_s(sheet.recordings)[hit.record] + hit.start_s


def located_hits(sheet: ModalTestReport) -> list[tuple[int, Hit]]:
    """Return the hits whose records are at hand, each with its number from 1."""
    numbered = enumerate(sheet.hits, 1)
    return [(number, hit) for number, hit in numbered if hit.record < len(sheet.recordings)]


def channel_of(record: Recording, row: int | None) -> Channel | None:
    """Return the force (`row` None) or the acceleration of that row; None where it has none."""
    if row is None:
        return record.force
    return record.accelerations[row] if row < len(record.accelerations) else None


def thinned(records: Sequence[Recording], row: int | None) -> tuple[FloatArray, FloatArray]:
    """Return time in s and values of one channel, thinned by their envelope; both (m,).

    NaN where samples are, and between the records, so that a line drawn through them breaks.
    """
    whole = sum(record.duration_s for record in records)
    times, values = [], []
    for offset, record in zip(offsets_s(records), records, strict=True):
        channel = channel_of(record, row)
        if channel is not None and len(channel.values):
            bins = max(8, round(_BINS * record.duration_s / whole))
            places = spec.envelope_places(channel.values, bins)
            times += [offset + places / record.sampling_rate_hz, np.array([np.nan])]
            values += [channel.values[places], np.array([np.nan])]
    return np.concatenate(times), np.concatenate(values)


def unknown_times_s(records: Sequence[Recording], row: int | None) -> FloatArray:
    """Return the middle of each bin with samples that are NaN, on the common axis, in s."""
    found: list[float] = []
    for offset, record in zip(offsets_s(records), records, strict=True):
        channel = channel_of(record, row)
        if channel is not None:
            bad = np.flatnonzero(np.isnan(channel.values))
            width = max(1, record.samples * len(records) // _BINS)
            found += (offset + np.unique(bad // width) * width / record.sampling_rate_hz).tolist()
    return np.array(found)


REACH_DB = -20.0
LOWEST_DB = -40.0
"""Below which no spectrum of a force is drawn."""
CURVE_BINS = 300
"""Into which a curve of a hit is thinned."""
_MOST_SHOWN = 12
_BEFORE_S, _AFTER_S = 0.006, 0.02
_FILTER_SAMPLES = 16
"""An anti-aliasing filter spreads a pulse over so many samples on either side."""
_SECOND_STRIKE_S = 0.5
_STRIKES = 0.05
_TRANSFORM_S = 0.5
_LEAD, _TAIL = 0.7, 3.0
"""Room before and after a pulse in a figure, in widths of it."""
_TINY = 1e-9  # stands for a level of 0 on an axis of dB


@dataclass(frozen=True, eq=False)
class HitRecord:
    """Hold the signals of one hit.

    `time_s` and `force_n` (samples,) of its pulse, 0 s where it begins; `spectrum_hz` and
    `spectrum_db` (lines,), relative to the spectrum's largest value.
    """

    number: int
    hit: Hit
    time_s: FloatArray
    force_n: FloatArray
    spectrum_hz: FloatArray
    spectrum_db: FloatArray

    @property
    def near_s(self) -> tuple[float, float]:
        """From a little before the pulse to a little after the last strike."""
        hit_at = self.force_n > _STRIKES * np.nanmax(self.force_n)
        peak = int(np.nanargmax(self.force_n))
        width = _run(hit_at[peak:]) + _run(hit_at[peak::-1])
        step_s = float(self.time_s[1] - self.time_s[0])
        last_s = float(self.time_s[np.flatnonzero(hit_at)[-1]])
        return -_LEAD * width * step_s, max(_TAIL * width * step_s, 1.1 * last_s)

    @property
    def reach_hz(self) -> float:
        """Return where the force first falls to a tenth of its largest; NaN where it never does."""
        top = int(np.argmax(self.spectrum_db))
        below = np.flatnonzero(self.spectrum_db[top:] < REACH_DB)
        return float(self.spectrum_hz[top + below[0]]) if len(below) else NAN


def hit_records(sheet: ModalTestReport) -> list[HitRecord]:
    """Return every hit whose record is at hand, in the order of the hits."""
    found = [_hit_record(sheet, number, hit) for number, hit in located_hits(sheet)]
    return [hit_record for hit_record in found if hit_record is not None]


def shown_hits(sheet: ModalTestReport) -> list[HitRecord]:
    """Return all hits, or some of them with every dropped one first."""
    dropped_first = sorted(hit_records(sheet), key=lambda hit_record: hit_record.hit.used)
    return sorted(dropped_first[:_MOST_SHOWN], key=lambda hit_record: hit_record.number)


def hit_name(hit_record: HitRecord) -> str:
    """Return `hit 2, dropped: double hit`."""
    reason = "" if hit_record.hit.used else f", dropped: {hit_record.hit.reason}"
    return f"hit {hit_record.number}{reason}"


def _hit_record(sheet: ModalTestReport, number: int, hit: Hit) -> HitRecord | None:
    record = sheet.recordings[hit.record]
    if (force := record.force) is None:
        return None
    rate, stop = record.sampling_rate_hz, _stop(sheet, hit)
    time_s, force_n = _pulse(force.values[:stop], hit, rate)
    spectrum_hz, spectrum_db = _spectrum(force_n, rate)
    return HitRecord(number, hit, time_s, force_n, spectrum_hz, spectrum_db)


def _run(hit_at: BoolArray) -> int:
    """Count how many of the first samples are true."""
    return len(hit_at) if np.all(hit_at) else int(np.argmin(hit_at))


def _stop(sheet: ModalTestReport, hit: Hit) -> int:
    """Return the sample shortly before the next hit in the record, or where the record ends."""
    record = sheet.recordings[hit.record]
    margin = int(_BEFORE_S * record.sampling_rate_hz) + _FILTER_SAMPLES
    later = [h.start for h in sheet.hits if h.record == hit.record and h.start > hit.start]
    stop = min([each - margin for each in later], default=record.samples)
    return max(stop, hit.start + 2)


def _pulse(force: FloatArray, hit: Hit, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return the pulse free of its offset, long enough for a second strike to be in it."""
    before = int(_BEFORE_S * rate) + _FILTER_SAMPLES
    first = max(0, hit.start - before)
    part = force[first : hit.start + int(_SECOND_STRIKE_S * rate)]
    part = part - np.nanmedian(part)
    if part[np.nanargmax(np.abs(part))] < 0:
        part = -part
    least = hit.start - first + int(_AFTER_S * rate) + _FILTER_SAMPLES
    hit_at = np.flatnonzero(part > _STRIKES * np.nanmax(part))
    last = max(least, int(1.1 * hit_at[-1])) if len(hit_at) else least
    places = np.arange(min(last, len(part)))
    return (first + places - hit.start) / rate, np.asarray(part[places])


def _spectrum(force_n: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return the pulse's spectrum; NaN, which is not drawn, where samples are missing."""
    length = max(len(force_n), int(_TRANSFORM_S * rate))
    size = np.abs(np.fft.rfft(force_n, n=length))
    decibel = 20 * np.log10(np.maximum(size / max(float(size.max()), _TINY), _TINY))
    return np.fft.rfftfreq(length, 1 / rate).astype(np.float64), np.asarray(decibel)


_COLOURS = ("blue", "orange", "green", "purple")
_DASHES: tuple[spec.Dash, ...] = ("solid", "dash", "dot")
_DROPPED_DASHES: tuple[spec.Dash, ...] = ("dash", "dot", "dashdot", "longdash")


def _draw(shown: ResponseCurves) -> spec.Specification | None:
    hits = shown_hits(shown.sheet)
    if not hits:
        return None
    columns = 6 if all(hit_record.hit.used for hit_record in hits) else 3
    return spec.stacked([_pulses(hits), _force_spectra(shown, hits)], 5.0, columns)


def _look(hit_record: HitRecord, place: int) -> dict[str, Any]:
    """Return colour, dashes and name of a hit: a dropped one is red."""
    name = hit_name(hit_record)
    if not hit_record.hit.used:
        dashes = _DROPPED_DASHES[place % len(_DROPPED_DASHES)]
        return {"name": name, "colour": "red", "dash": dashes, "width": 1.1}
    dashes = _DASHES[place // len(_COLOURS) % len(_DASHES)]
    colour = _COLOURS[place % len(_COLOURS)]
    return {"name": name, "colour": colour, "dash": dashes, "width": 0.9}


def _pulses(hits: Sequence[HitRecord]) -> spec.Panel:
    lines = []
    for place, hit_record in enumerate(hits):
        retained = spec.envelope_places(hit_record.force_n, CURVE_BINS)
        lines.append(
            spec.Line(
                x=1e3 * hit_record.time_s[retained], y=hit_record.force_n[retained],
                hover="%{x:.1f} ms: %{y:.4g} N",
                **_look(hit_record, place),
            )
        )  # fmt: skip
    spans_ms = 1e3 * np.array([hit_record.near_s for hit_record in hits])
    return spec.Panel(
        y=spec.Axis(label="force (N)"), marks=lines,
        x=spec.Axis(
            label="time from the start of the hit (ms)",
            range=(float(spans_ms[:, 0].min()), float(spans_ms[:, 1].max())),
        ),
    )  # fmt: skip


def _force_spectra(shown: ResponseCurves, hits: Sequence[HitRecord]) -> spec.Panel:
    highest = float(hits[0].spectrum_hz[-1])
    low, high = searched_range(shown.sheet)
    high = min(high, highest)
    end = min(2 * high, highest)
    lines = []
    for place, hit_record in enumerate(hits):
        # Far below the panel nothing is drawn, as lines to there would cross others outside it.
        retained = (hit_record.spectrum_hz <= end) & (hit_record.spectrum_db > LOWEST_DB - 20)
        found = np.where(retained, hit_record.spectrum_db, np.nan)
        places = spec.envelope_places(found, CURVE_BINS)
        lines.append(
            spec.Line(
                x=hit_record.spectrum_hz[places], y=found[places], hover="%{x:.1f} Hz: %{y:.3g} dB",
                **_look(hit_record, place),
            )
        )  # fmt: skip
    level = spec.Rule(at=REACH_DB, width=0.8, dash="dashdot", label="a tenth of the force")
    band = spec.Span(low=low, high=high, colour="green", opacity=0.10)
    what = "band" if shown.sheet.band_hz else "where modes were found"
    return spec.Panel(
        y=spec.Axis(label="force, relative (dB)", range=(LOWEST_DB, 2)),
        marks=[*lines, level, band],
        x=spec.Axis(label="frequency (Hz)", range=(0, end)), title=f"shaded: {what}",
    )  # fmt: skip


def _caption(shown: ResponseCurves) -> str:
    sheet = shown.sheet
    some = formatting.some(len(shown_hits(sheet)), len(sheet.hits), "hits")
    return (
        "The force of each hit, and its spectrum relative to its largest value: it should stay "
        f"above a tenth (-20 dB) up to the end of the band. Sound hits lie over each other.{some}"
    )


def _alt(shown: ResponseCurves) -> str:
    hits = shown_hits(shown.sheet)
    reaches = [b.reach_hz for b in hits if b.hit.used and np.isfinite(b.reach_hz)]
    forces = [hit_record.hit.peak_force_n for hit_record in hits]
    reach = f" A tenth of the force is left at {np.median(reaches):.0f} Hz." if reaches else ""
    return (
        f"{formatting.counted(len(hits), 'hit')} of {formatting.plain(min(forces))} to "
        f"{formatting.plain(max(forces))} N laid over each other.{reach}"
    )


FIGURE = spec.FigureSpec("hits", "Hits: pulses and force spectra", _draw, _caption, _alt)
