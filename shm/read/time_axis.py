"""Times of samples: the even grid that they lie on, and the gaps that they show."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from shm.errors import BadInput
from shm.values import NAN, FloatArray, IntArray

REMEDY = "Export with an even time step, or drop the times and give sampling_rate_hz."
_MOST_JITTER = 0.4  # samples: times rounded to milliseconds are off by 0.26 of one at 512 Hz
_MANY_GAPS = 0.05  # judgement: no link loses every twentieth sample, one by one and evenly
_WHOLE = 0.01  # of a sample: rounding of the sums
_MOST_GAP = 2  # a file whose gaps outweigh its data is refused, not filled up
_FINE = 1e-4  # judgement: of the span; times rounded more coarsely do not give the rate alone
_AGREES = 0.02  # judgement: of a stated rate; a coarse clock says no more

Refusal = Callable[[int, str], BadInput]
"""Makes the error for a sample (from 0) and a reason."""


def on_even_grid(
    times_s: FloatArray, values: FloatArray, refusal: Refusal, stated_hz: float = NAN
) -> tuple[FloatArray, float]:
    """Return values (channels, samples) on an even grid, and the rate in Hz.

    Samples that the times skip become NaN. The rate is NaN for one time, and where times of which
    several are equal do not tell it, or agree with the rate that is stated. Raises the refusal of a
    time that is uneven.
    """
    if len(times_s) < 2:
        return values, NAN
    places, rate = _places(times_s, refusal, stated_hz)
    if places[-1] == len(places) - 1:
        return values, rate
    filled = np.full((len(values), places[-1] + 1), NAN)
    filled[:, places] = values
    return filled, rate


def rate_of(times_s: FloatArray, refusal: Refusal, stated_hz: float = NAN) -> float:
    """Return the rate of `on_even_grid`."""
    return _places(times_s, refusal, stated_hz)[1] if len(times_s) > 1 else NAN


def _places(times: FloatArray, refusal: Refusal, stated_hz: float) -> tuple[IntArray, float]:
    """Return the sample that each time belongs to, and the rate in Hz.

    Two readings compete: times rounded but without gaps, and times exact but with gaps.
    """
    steps, since = np.diff(times), times - times[0]
    plain = np.arange(len(times))
    if len(wrong := np.flatnonzero(~(steps >= 0))):
        raise refusal(int(wrong[0]) + 1, "the time does not increase")
    if not steps.all():
        return plain, _rate_of_coarse(since, refusal, stated_hz)
    multiples = np.rint(steps / np.median(steps))
    gapped = np.append(0, np.cumsum(np.maximum(multiples, 1)))
    off_plain, off_gapped = (
        float(np.abs(since * places[-1] / since[-1] - places).max()) for places in (plain, gapped)
    )
    rounded = np.mean(multiples != 1) > _MANY_GAPS and off_plain <= _rounding(since)
    has_gaps = off_gapped < off_plain and not rounded
    if not rounded and min(off_plain, off_gapped) > _MOST_JITTER:
        oddest = int(np.argmax(np.abs(steps - np.median(steps))))
        raise refusal(oddest + 1, "the times are uneven")
    places = (gapped if has_gaps else plain).astype(np.int64)
    if places[-1] >= _MOST_GAP * len(places):
        raise refusal(int(np.argmax(np.diff(places))) + 1, "there is a long gap")
    return places, float(places[-1] / since[-1])


def _rounding(since: FloatArray) -> float:
    """Return the largest rounding error of times in samples, by the last digit of their clock.

    At 800 Hz in ms the steps are 1, 1, 1, 2 ms. Half a digit is of the time itself, half of the
    first and the last, that the others are held to.
    """
    digits = (10.0**-power for power in range(7))
    last = next((d for d in digits if np.abs(since / d - np.rint(since / d)).max() < 1e-3), 0.0)
    return last * (len(since) - 1) / float(since[-1]) + _WHOLE


def _rate_of_coarse(since: FloatArray, refusal: Refusal, stated_hz: float) -> float:
    """Return the rate of times of which several are equal; NaN if only a statement gives it."""
    steps = np.diff(since)
    moves = np.flatnonzero(steps > 0)
    if len(moves) < 2:
        return NAN
    coarse, span = float(steps[moves].min()), float(since[-1])
    off = since - np.arange(len(since)) * span / (len(since) - 1)
    if off.max() - off.min() > 2.2 * coarse:
        raise refusal(int(np.argmax(np.abs(off))), "the times are uneven")
    if coarse / span <= _FINE:
        return (len(since) - 1) / span
    # From the first step of the clock to the last there are whole seconds, or whatever it counts.
    inner = float((moves[-1] - moves[0]) / (since[moves[-1] + 1] - since[moves[0] + 1]))
    counts = np.diff(moves)
    if not math.isnan(stated_hz):
        return NAN if abs(inner / stated_hz - 1) < _AGREES else inner
    return float(np.rint(inner)) if counts.max() - counts.min() <= 1 else NAN
