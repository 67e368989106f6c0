"""What the error of a tension that was read leaves in the frequencies of its test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shm.gap.contract import Design
from shm.values import FloatArray

_STEP_SD = 0.01

Predict = Callable[[Design], FloatArray]
"""The logarithms of the frequencies (F,) that the baseline predicts of a design."""


def reading_loads(design: Design, predict: Predict) -> FloatArray:
    """Loads (F, tests with a reading): what one standard deviation of each reading does.

    All modes of a test move together, those of other tests do not.
    """
    read = [t for t, each in enumerate(design.conditions) if each.tension_shift_sd_n > 0]
    if not read:
        return np.zeros((design.frequencies, 0))
    moved = replace(
        design,
        conditions=tuple(
            replace(each, tension_shift_n=each.tension_shift_n + _STEP_SD * each.tension_shift_sd_n)
            for each in design.conditions
        ),
    )
    change = (predict(moved) - predict(design)) / _STEP_SD
    return np.where(design.frequency_test[:, None] == read, change[:, None], 0.0)
