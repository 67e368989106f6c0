"""sdypy-EMA, told approximate frequencies: `get_poles` and `select_closest_poles`, defaults.

Its only way without a person at the stability chart wants approximate natural frequencies. It is
told those of the truth, within 1 %.
"""

from __future__ import annotations

import numpy as np
from given import Given, answer
from numpy.typing import NDArray
from sdypy import EMA


def picked(given: Given, approximate: NDArray[np.float64]) -> NDArray[np.float64]:
    """Natural frequencies in Hz."""
    model = EMA.Model(given.accelerance, given.frequency, lower=given.band[0], upper=given.band[1])
    model.get_poles(show_progress=False)
    model.select_closest_poles(approximate.tolist())
    return np.unique(model.nat_freq)


def run(given: Given) -> NDArray[np.float64]:
    return picked(given, given.told)


if __name__ == "__main__":
    answer("sdypy-ema", run)
