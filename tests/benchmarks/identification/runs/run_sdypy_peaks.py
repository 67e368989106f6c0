"""sdypy-EMA, told the peaks of the measured accelerance: nobody knows the hanger.

Peaks of the sum of squares over the channels that stand 10 dB above what surrounds them.
"""

from __future__ import annotations

import numpy as np
from given import Given, answer
from numpy.typing import NDArray
from run_sdypy_told import picked
from scipy.signal import find_peaks

_PROMINENCE_DB = 10.0


def run(given: Given) -> NDArray[np.float64]:
    level = 10 * np.log10(np.sum(np.abs(given.accelerance) ** 2, axis=0) + 1e-300)
    inside = (given.frequency > given.band[0]) & (given.frequency < given.band[1])
    peaks, _ = find_peaks(np.where(inside, level, level.min()), prominence=_PROMINENCE_DB)
    return picked(given, given.frequency[peaks])


if __name__ == "__main__":
    answer("sdypy-ema", run)
