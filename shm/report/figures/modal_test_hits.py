"""Draw all hits of a test laid over each other: pulse and force spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.report.figures.modal_test_axes import ResponseCurves, searched_range
from shm.values import FloatArray

if TYPE_CHECKING:
    from shm.identify import Hit

REACH_DB, _LOWEST_DB = -20.0, -40.0  # a tenth of the force; where the panel ends
_MOST_SHOWN, _BINS = 12, 300  # layout: hits, and spans into which a curve is thinned
# Technical: before a pulse is rest; a second strike comes within half a second; 0.5 s give lines
# every 2 Hz; a twentieth of the largest force is a strike.
_BEFORE_S, _LONGEST_S, _STRIKE = 0.006, 0.5, 0.05
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
        """Return from a little before the pulse to a little after its last strike."""
        strikes = self.time_s[self.force_n > _STRIKE * np.nanmax(self.force_n)]
        return -_BEFORE_S, float(np.max(strikes, initial=0.0)) + _BEFORE_S

    @property
    def reach_hz(self) -> float:
        """Return where the force first falls to a tenth of its largest; NaN where it never does."""
        top = int(np.argmax(self.spectrum_db))
        below = np.flatnonzero(self.spectrum_db[top:] < REACH_DB)
        return float(self.spectrum_hz[top + below[0]]) if len(below) else float("nan")


def shown_hits(sheet: ModalTestReport) -> list[HitRecord]:
    """Return all hits with a force, or some of them with every dropped one first."""
    dropped_first = sorted(sheet.located_hits, key=lambda each: each[1].used)[:_MOST_SHOWN]
    records = (_hit_record(sheet, number, hit) for number, hit in sorted(dropped_first))
    return [record for record in records if record is not None]


def _hit_record(sheet: ModalTestReport, number: int, hit: Hit) -> HitRecord | None:
    """Return the pulse free of its offset, until shortly before the next hit, and its spectrum.

    The spectrum is NaN, which is not drawn, where samples are missing.
    """
    record = sheet.recordings[hit.record]
    if record.force is None:
        return None
    rate = record.sampling_rate_hz
    before = int(_BEFORE_S * rate)
    later = [h.start for h in sheet.hits if h.record == hit.record and h.start > hit.start]
    stop = min([each - before for each in later], default=record.samples)
    first = max(0, hit.start - before)
    stop = max(min(stop, hit.start + int(_LONGEST_S * rate)), hit.start + 2)
    force = record.force.values[first:stop]
    force = force - np.nanmedian(force)
    if force[np.nanargmax(np.abs(force))] < 0:
        force = -force
    length = max(len(force), int(_LONGEST_S * rate))
    size = np.abs(np.fft.rfft(force, n=length))
    decibel = 20 * np.log10(np.maximum(size / max(float(size.max()), _TINY), _TINY))
    time_s = (first + np.arange(len(force)) - hit.start) / rate
    line_hz = np.fft.rfftfreq(length, 1 / rate).astype(np.float64)
    return HitRecord(number, hit, time_s, force, line_hz, np.asarray(decibel))


def _name(hit_record: HitRecord) -> str:
    """Return `hit 2, dropped: double hit`."""
    reason = "" if hit_record.hit.used else f", dropped: {hit_record.hit.reason}"
    return f"hit {hit_record.number}{reason}"


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
    name = _name(hit_record)
    if not hit_record.hit.used:
        dashes = _DROPPED_DASHES[place % len(_DROPPED_DASHES)]
        return {"name": name, "colour": "red", "dash": dashes, "width": 1.1}
    dashes = _DASHES[place // len(_COLOURS) % len(_DASHES)]
    colour = _COLOURS[place % len(_COLOURS)]
    return {"name": name, "colour": colour, "dash": dashes, "width": 0.9}


def _pulses(hits: Sequence[HitRecord]) -> spec.Panel:
    lines = []
    for place, hit_record in enumerate(hits):
        retained = spec.envelope_places(hit_record.force_n, _BINS)
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
        retained = (hit_record.spectrum_hz <= end) & (hit_record.spectrum_db > _LOWEST_DB - 20)
        found = np.where(retained, hit_record.spectrum_db, np.nan)
        places = spec.envelope_places(found, _BINS)
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
        y=spec.Axis(label="force, relative (dB)", range=(_LOWEST_DB, 2)),
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
