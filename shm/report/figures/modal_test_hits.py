"""The hits laid over each other: pulse, force spectrum, ring-down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shm.report import formatting
from shm.report.figures.modal_test_signals import (
    CURVE_BINS,
    LOWEST_DB,
    REACH_DB,
    HitRecord,
    hit_name,
    shown_hits,
)
from shm.report.figures.modal_test_spectra import Shown, searched_range
from shm.report.figures.specification import (
    Axis,
    Dash,
    Line,
    Member,
    Panel,
    Rule,
    Span,
    Specification,
    envelope_places,
)

_COLOURS = ("blue", "orange", "green", "purple")
_DASHES: tuple[Dash, ...] = ("solid", "dash", "dot")
_DROPPED_DASHES: tuple[Dash, ...] = ("dash", "dot", "dashdot", "longdash")
_FADE_ROOM = 1.3  # layout: room to the right of the last hit


def _draw(shown: Shown) -> Specification | None:
    hits = shown_hits(shown.sheet)
    if not hits:
        return None
    panels = [_pulses(hits), _spectra(shown, hits), _fades(hits)]
    rows = [[each] for each in panels] if shown.is_on_screen else [panels[:2], panels[2:]]
    columns = 6 if all(hit_record.hit.used for hit_record in hits) else 3
    return Specification(rows=rows, height_inches=5.4, legend_columns=columns)


def _look(hit_record: HitRecord, place: int) -> dict[str, Any]:
    """Colour, dashes and name of a hit: a dropped one is red."""
    name = hit_name(hit_record)
    if not hit_record.hit.used:
        dashes = _DROPPED_DASHES[place % len(_DROPPED_DASHES)]
        return {"name": name, "colour": "red", "dash": dashes, "width": 1.1}
    dashes = _DASHES[place // len(_COLOURS) % len(_DASHES)]
    colour = _COLOURS[place % len(_COLOURS)]
    return {"name": name, "colour": colour, "dash": dashes, "width": 0.9}


def _pulses(hits: Sequence[HitRecord]) -> Panel:
    lines = []
    for place, hit_record in enumerate(hits):
        kept = envelope_places(hit_record.force_n, CURVE_BINS)
        lines.append(
            Line(
                x=1e3 * hit_record.time_s[kept], y=hit_record.force_n[kept],
                hover="%{x:.1f} ms: %{y:.4g} N",
                **_look(hit_record, place),
            )
        )  # fmt: skip
    spans_ms = 1e3 * np.array([hit_record.near_s for hit_record in hits])
    return Panel(
        y=Axis(label="force (N)"), marks=lines,
        x=Axis(
            label="time from the start of the hit (ms)",
            range=(float(spans_ms[:, 0].min()), float(spans_ms[:, 1].max())),
        ),
    )  # fmt: skip


def _spectra(shown: Shown, hits: Sequence[HitRecord]) -> Panel:
    highest = float(hits[0].spectrum_hz[-1])
    low, high = searched_range(shown.sheet)
    high = min(high, highest)
    end = min(2 * high, highest)
    lines = []
    for place, hit_record in enumerate(hits):
        # Far below the panel nothing is drawn, as lines to there would cross others outside it.
        kept = (hit_record.spectrum_hz <= end) & (hit_record.spectrum_db > LOWEST_DB - 20)
        found = np.where(kept, hit_record.spectrum_db, np.nan)
        places = envelope_places(found, CURVE_BINS)
        lines.append(
            Line(
                x=hit_record.spectrum_hz[places], y=found[places], hover="%{x:.1f} Hz: %{y:.3g} dB",
                **_look(hit_record, place),
            )
        )  # fmt: skip
    level = Rule(at=REACH_DB, width=0.8, dash="dashdot", label="a tenth of the force")
    band = Span(low=low, high=high, colour="green", opacity=0.10)
    what = "band" if shown.sheet.band_hz else "where modes were found"
    return Panel(
        y=Axis(label="force, relative (dB)", range=(LOWEST_DB, 2)), marks=[*lines, level, band],
        x=Axis(label="frequency (Hz)", range=(0, end)), title=f"shaded: {what}",
    )  # fmt: skip


def _fades(hits: Sequence[HitRecord]) -> Panel:
    values = np.concatenate([hit_record.fade_m_s2_n for hit_record in hits])
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.1, 1.0)
    axis = Axis(scale="log", range=(low / _FADE_ROOM, high * _FADE_ROOM))
    return Panel(
        y=replace(axis, label="largest acceleration\nper peak force (m/s²/N)"),
        marks=[
            Line(
                x=hit_record.fade_s, y=hit_record.fade_m_s2_n, hover="%{x:.2f} s: %{y:.3g} m/s²/N",
                **_look(hit_record, place),
            )
            for place, hit_record in enumerate(hits)
        ],
        x=Axis(
            label="time from the start of the hit (s)",
            range=(0, max(float(hit_record.fade_s[-1]) for hit_record in hits)),
        ),
    )  # fmt: skip


def _caption(shown: Shown) -> str:
    sheet = shown.sheet
    some = formatting.some(len(shown_hits(sheet)), len(sheet.hits), "hits")
    return (
        "Above, the force of each hit and its spectrum, each relative to its largest value: it "
        "should stay above a tenth (-20 dB) up to the end of the band. Below, the largest "
        "acceleration of each short span after the hit, per peak force: sound hits lie over each "
        f"other.{some}"
    )


def _alt(shown: Shown) -> str:
    hits = shown_hits(shown.sheet)
    reaches = [b.reach_hz for b in hits if b.hit.used and np.isfinite(b.reach_hz)]
    forces = [hit_record.hit.peak_force_n for hit_record in hits]
    reach = f" A tenth of the force is left at {np.median(reaches):.0f} Hz." if reaches else ""
    return (
        f"{formatting.counted(len(hits), 'hit')} of {formatting.plain(min(forces))} to "
        f"{formatting.plain(max(forces))} N laid over each other.{reach}"
    )


FIGURE = Member("hits", "Hits: pulses, force spectra, ring-downs", _draw, _caption, _alt)
