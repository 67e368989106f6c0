"""Each hit by itself: when, how hard, used or why not, and each mode's frequency and damping in it.

In stretches of a ring-down the found poles and shapes are fitted to all channels; how a mode's
phase turns and its amplitude falls beside the pole is its frequency and damping in that hit.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.identify.contract import FoundMode, Hit, Measurement
from shm.identify.estimation.courses import RingDownCourse, course_of, phases_of
from shm.identify.measuring.signal_faults import DOUBLE_HIT
from shm.values import NAN, Mode

_SAME_MODE = 0.005  # judgement: set-ups and the end of softening see one mode as far apart


@dataclass(frozen=True)
class HitModes:
    """Hold the frequency in Hz and damping ratio of each numbered mode after one hit.

    They are in the order of the modes; NaN where a mode is below the noise of that hit.
    """

    hit: Hit
    frequency_hz: tuple[float, ...]
    damping_ratio: tuple[float, ...]


def modes_of_each_hit(
    measurements: Sequence[Measurement],
    found: Sequence[Sequence[FoundMode]],
    modes: Sequence[Mode],
) -> tuple[HitModes, ...]:
    """Return all hits in time; `found` are each set-up's modes, shapeless where it saw none."""
    rows = []
    for measurement, seen in zip(measurements, found, strict=True):
        measured = [mode for mode in seen if len(mode.shape) == len(measurement.points)]
        decays = iter(measurement.decays)
        for hit in measurement.hits:
            known = [(NAN, NAN)] * len(modes)
            if hit.used and (decay := next(decays, None)) is not None and measured:
                course = course_of(decay, measured, measurement.sampling_rate_hz)
                known = [_in_course(course, measured, mode) for mode in modes]
            rows.append(HitModes(hit, tuple(f for f, _ in known), tuple(z for _, z in known)))
    return tuple(sorted(rows, key=lambda row: (row.hit.record, row.hit.start)))


def _in_course(
    course: RingDownCourse, found: Sequence[FoundMode], mode: Mode
) -> tuple[float, float]:
    """Return frequency and damping ratio of a mode in one ring-down, by weighted straight lines."""
    away = [abs(each.frequency_hz / mode.frequency_hz - 1) for each in found]
    index = int(np.argmin(away))
    of_course = found[index]
    decay = 2 * math.pi * of_course.frequency_hz * of_course.damping_ratio
    row = phases_of(course, index, decay) if away[index] < _SAME_MODE else None
    if row is None:
        return NAN, NAN
    time_s, phase, sd, _ = row
    size = np.abs(course.motion[: len(time_s), index])
    turn = np.polyfit(time_s, phase, 1, w=1 / sd)[0]
    fall = -np.polyfit(time_s, np.log(size), 1, w=1 / sd)[0]
    frequency_hz = of_course.frequency_hz + turn / (2 * math.pi)
    return float(frequency_hz), float((decay + fall) / (2 * math.pi * frequency_hz))


def as_csv(rows: Sequence[HitModes], modes: Sequence[Mode]) -> str:
    """Return a line for each hit: record, time, force, double hit, use and reason, then each mode.

    What is not known is left empty.
    """
    names = [f"{mode.plane}_{mode.order}" for mode in modes]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(
        ["hit", "record", "time_s", "peak_force_n", "double_hit", "used", "reason"]
        + [f"{name}_{what}" for name in names for what in ("hz", "damping")]
    )
    for number, row in enumerate(rows, 1):
        hit = row.hit
        reason = hit.reason or hit.cut
        double = "yes" if reason.startswith(DOUBLE_HIT) else "no"
        known = [
            _number(value)
            for pair in zip(row.frequency_hz, row.damping_ratio, strict=True)
            for value in pair
        ]
        table.writerow([
            number, hit.record + 1, f"{hit.start_s:.3f}", _number(hit.peak_force_n), double,
            "yes" if hit.used else "no", reason, *known,
        ])  # fmt: skip
    return text.getvalue()


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""
