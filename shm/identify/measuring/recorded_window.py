"""Whether an analyser laid an exponential window on the records before it wrote them.

It makes all modes seem more damped by one rate of decay, and with it falls what in a recording
never falls by itself: the noise of the hammer between its hits.
"""

from __future__ import annotations

import math

import numpy as np

from shm.identify.contract import Measurement

_AFTER_S = 0.5  # judgement: the pulse, its filter's ringing and the hand's shaking are over
_BLOCKS = 8
_LEAST_SAMPLES = 32  # of a block: its level is known to an eighth
_LEAST_FALL = math.log(3.0)
"""Of the noise over a ring-down: eight times what chance makes of it in such blocks."""
_MOST_ASTRAY = 0.25
"""Of the logarithm of a block's level, root mean square: twice what chance does."""


def recorded_window_rate(measurement: Measurement) -> float:
    """Its rate of decay in 1/s, the median over the hits; 0 where there is none to be seen."""
    rate_hz = measurement.sampling_rate_hz
    rates = []
    for driven in measurement.driven:
        begin = int(np.argmax(np.abs(driven[0]))) + int(_AFTER_S * rate_hz)
        noise = np.diff(driven[0, begin:])
        length = len(noise) // _BLOCKS
        if length < _LEAST_SAMPLES:
            return 0.0
        levels = noise[: length * _BLOCKS].reshape(_BLOCKS, length).std(axis=1)
        if not np.all(levels > 0):
            return 0.0
        middle_s = np.arange(_BLOCKS) * length / rate_hz
        line = np.polynomial.Polynomial.fit(middle_s, np.log(levels), 1)
        astray = float(np.std(np.log(levels) - line(middle_s)))
        fall = float(line(middle_s[0]) - line(middle_s[-1]))
        rates.append(fall / middle_s[-1] if fall > _LEAST_FALL and astray < _MOST_ASTRAY else 0.0)
    return float(np.median(rates)) if rates else 0.0
