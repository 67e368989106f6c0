"""Times of samples: the sampling rate they tell, and the gaps they show."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shm.errors import BadInput
from shm.values import NAN, FloatArray, IntArray

_MOST_JITTER = 0.4  # samples: times rounded to milliseconds are off by 0.26 of one at 512 Hz
_MOST_GAP = 2  # a file whose gaps outweigh its data is refused, not filled up
REMEDY = "Export with an even time step, or drop the times and give sampling_rate_hz."


def evened(
    times_s: FloatArray, values: FloatArray, refusal: Callable[[int, str], BadInput]
) -> tuple[FloatArray, float]:
    """Values (channels, samples) on an even grid, and the rate in Hz (NaN for a single time).

    Samples that the times skip become NaN. Where times do not run evenly it raises the `refusal`
    of that sample (from 0) for that reason.
    """
    if len(times_s) < 2:
        return values, NAN
    places, rate = _places(times_s, refusal)
    filled = np.full((len(values), places[-1] + 1), NAN)
    filled[:, places] = values
    return filled, rate


def rate_of(times_s: FloatArray, refusal: Callable[[int, str], BadInput]) -> float:
    """The rate that times tell, in Hz; raises the `refusal` where they do not run evenly."""
    return _places(times_s, refusal)[1] if len(times_s) > 1 else NAN


def _places(times: FloatArray, refusal: Callable[[int, str], BadInput]) -> tuple[IntArray, float]:
    """The sample that each time belongs to, and the rate in Hz.

    Two readings compete: times rounded but without gaps, and times exact but with gaps.
    """
    steps = np.diff(times)
    wrong = np.flatnonzero(~(steps > 0))
    if len(wrong):
        raise refusal(int(wrong[0]) + 1, "the time does not increase")
    multiples = np.rint(steps / np.median(steps))
    readings = [np.arange(len(times)), np.append(0, np.cumsum(np.maximum(multiples, 1)))]
    deviations = [
        (times - times[0]) * places[-1] / (times[-1] - times[0]) - places for places in readings
    ]
    best = min((0, 1), key=lambda reading: float(np.abs(deviations[reading]).max()))
    if not np.abs(deviations[best]).max() <= _MOST_JITTER:
        oddest = int(np.argmax(np.abs(steps - np.median(steps))))
        raise refusal(oddest + 1, "the times are uneven")
    places = readings[best].astype(np.int64)
    if places[-1] >= _MOST_GAP * len(places):
        raise refusal(int(np.argmax(np.diff(places))) + 1, "there is a long gap")
    return places, float(places[-1] / (times[-1] - times[0]))
