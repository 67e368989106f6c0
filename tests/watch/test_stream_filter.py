"""The bank of filters of a permanent sensor over a silence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.watch.sensors.stream_filter import FEATURES, LEVEL, Bank

COEFFICIENT_SD = np.array([0.001])


def bank() -> Bank:
    """Return a bank in which one filter has held and the others have not."""
    begun = Bank.begun(0.0, COEFFICIENT_SD)
    return replace(begun, log_weight=-4.0 * np.arange(len(begun.log_weight)))


def level() -> np.ndarray:
    direction = np.zeros(FEATURES + len(COEFFICIENT_SD))
    direction[LEVEL] = 1.0
    return direction


def test_silence_forgets_which_filter_held() -> None:
    held = [bank().advanced(day, COEFFICIENT_SD).weight[0] for day in (0.0, 30.0, 365.0)]
    assert held[0] > held[1] > held[2]
    assert held[2] < 1.1 / len(bank().weight)


def test_silence_widens_the_level() -> None:
    sds = [bank().advanced(day, COEFFICIENT_SD).along(level())[1] for day in (1.0, 30.0, 365.0)]
    assert sds[0] < sds[1] < sds[2]
