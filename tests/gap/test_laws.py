"""An allowance for the error of an effect's own law."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.contract import Fit
from shm.gap.laws import law_gain
from shm.values import FloatArray
from tests.gap import linear_toy as toy

SHIFT = toy.stiffening(5e-3)
RIGID = np.zeros((toy.design().size, 1))


def _gain(truth: FloatArray, seed: int = 1) -> float:
    """Of a fit that predicts SHIFT where `truth` is what happened."""
    data = toy.observations(truth + toy.noise(np.random.default_rng(seed)))
    return law_gain(data, _fit(np.zeros(toy.design().size)), _fit(SHIFT))


def _fit(predicted: FloatArray) -> Fit:
    return toy.fit(predicted, RIGID)


def test_a_law_that_is_off_by_a_tenth_is_forgiven() -> None:
    order = toy.design().frequency_order
    off = SHIFT.copy()
    off[: len(order)] *= 1 + 0.1 * np.where(order % 2, 1.0, -1.0)
    assert _gain(off) > 10


def test_an_exact_law_pays_little_for_the_allowance() -> None:
    gains = [_gain(SHIFT, seed) for seed in range(5)]
    assert all(np.log(0.4) <= gain < 0.5 for gain in gains)


def test_what_the_effect_does_not_touch_is_not_forgiven() -> None:
    elsewhere = SHIFT.copy()
    elsewhere[-1] += 30 * toy.SHAPE_SD
    assert _gain(elsewhere) == pytest.approx(_gain(SHIFT), abs=0.5)
