"""A column of times: the sampling rate it tells, and the gaps it shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shm.errors import BadInput
from shm.read.comma_header import Heading
from shm.read.table import parse_table
from shm.values import NAN, FloatArray, IntArray

_MOST_JITTER = 0.4  # samples: times rounded to milliseconds are off by 0.26 of one at 512 Hz
_MOST_GAP = 2  # a file whose gaps outweigh its data is refused, not filled up


def without_time(heading: Heading, table: FloatArray, path: Path) -> tuple[FloatArray, float]:
    """Channels (channels, samples) and the rate that the times tell (NaN without such a column).

    Samples that the times skip become NaN. Raises BadInput where times do not run evenly.
    """
    if not heading.has_time:
        return table, NAN
    times, values = table[0], table[1:]
    if len(times) < 2:
        return values, NAN
    places, rate = _places(times, heading, path)
    if places[-1] >= _MOST_GAP * len(places):
        raise _refusal(heading, path, int(np.argmax(np.diff(places))) + 1, "there is a long gap")
    filled = np.full((len(values), places[-1] + 1), NAN)
    filled[:, places] = values
    return filled, rate


def rate_of(heading: Heading, path: Path) -> float:
    """The rate that the column of times tells, NaN without one; raises BadInput where faulty."""
    if not heading.has_time:
        return NAN
    return without_time(heading, parse_table(heading, path), path)[1]


def _places(times: FloatArray, heading: Heading, path: Path) -> tuple[IntArray, float]:
    """The sample that each time belongs to, and the rate in Hz.

    Two readings compete: times rounded but without gaps, and times exact but with gaps.
    """
    steps = np.diff(times)
    wrong = np.flatnonzero(~(steps > 0))
    if len(wrong):
        raise _refusal(heading, path, int(wrong[0]) + 1, "the time does not increase")
    multiples = np.rint(steps / np.median(steps))
    readings = [np.arange(len(times)), np.append(0, np.cumsum(np.maximum(multiples, 1)))]
    deviations = [
        (times - times[0]) * places[-1] / (times[-1] - times[0]) - places for places in readings
    ]
    best = min((0, 1), key=lambda reading: float(np.abs(deviations[reading]).max()))
    if np.abs(deviations[best]).max() > _MOST_JITTER:
        oddest = int(np.argmax(np.abs(steps - np.median(steps))))
        raise _refusal(heading, path, oddest + 1, "the times are uneven")
    places = readings[best].astype(np.int64)
    return places, float(places[-1] / (times[-1] - times[0]))


def _refusal(heading: Heading, path: Path, row: int, what: str) -> BadInput:
    return BadInput(
        f"{what}.",
        file=path,
        channel=heading.columns[0],
        line=heading.body_line + row,
        remedy="Export with an even time step, or drop the column and give sampling_rate_hz.",
    )
