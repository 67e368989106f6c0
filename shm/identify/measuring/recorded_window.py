"""Whether an analyser laid an exponential window on the records before it wrote them.

It makes all modes seem more damped by one rate of decay, and with it falls what in a recording
never falls by itself: the noise of the hammer between its hits, and that of each accelerometer,
which is what no rule foretells of a ring-down. A force window leaves the latter alone.
"""

from __future__ import annotations

import math

import numpy as np

from shm.identify.contract import Measurement
from shm.identify.measuring.prediction import prediction_rule
from shm.values import FloatArray

_AFTER_S = 0.5  # judgement: the pulse, its filter's ringing and the hand's shaking are over
_BLOCKS = 8
_LEAST_SAMPLES = 32  # of a block: its level is known to an eighth
_LEAST_FALL = math.log(3.0)
"""Of the noise over a ring-down: eight times what chance makes of it in such blocks. Of 28 sound
tests of tests/worlds/recordings.py the accelerometers' fell by 0.4 at most, in the median."""
_MOST_ASTRAY = 0.4
"""Of the logarithm of a block's level, root mean square: three times what chance does."""


def recorded_window_rate(measurement: Measurement) -> float:
    """Its rate of decay in 1/s, the median over the hits; 0 where there is none to be seen."""
    if not measurement.hits:
        return 0.0
    rate_hz, after = measurement.sampling_rate_hz, int(_AFTER_S * measurement.sampling_rate_hz)
    by_force = [
        _rate(np.diff(driven[0, int(np.argmax(np.abs(driven[0]))) + after :]), rate_hz)
        for driven in measurement.driven
    ]
    seen = float(np.median(by_force)) if by_force else 0.0
    return seen or _rate_of_motion(measurement, after)


def _rate_of_motion(measurement: Measurement, after: int) -> float:
    """That by which the noise of all accelerometers falls after all hits."""
    rates = []
    for row in range(len(measurement.points)):
        parts = [decay[row] for decay in measurement.decays if decay.shape[1] > _BLOCKS * after]
        rule = prediction_rule(parts) if parts else np.empty(0)
        for part in parts:
            error = np.convolve(part, rule, mode="valid")[after:]
            rates.append(_rate(error, measurement.sampling_rate_hz))
    own = 1 / measurement.decay_time_constant_s
    return float(np.median(rates)) - own if rates and min(rates) > own else 0.0


def _rate(noise: FloatArray, rate_hz: float) -> float:
    """The rate by which the level of noise falls; 0 where it does not, or not evenly."""
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
    return fall / float(middle_s[-1]) if fall > _LEAST_FALL and astray < _MOST_ASTRAY else 0.0
