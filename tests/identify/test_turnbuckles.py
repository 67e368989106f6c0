"""What a turnbuckle does to the frequencies, against the simulator's elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.identify.mode_ordering.bars import turnbuckle_shift
from shm.simulate import HangerState
from shm.values import Hanger, Turnbuckle
from tests.worlds.simulated.elements import natural_frequencies

BAR = Hanger(1, 12.0, 200e9, 0.00283, 6.4e-7, 22.1, 300e3)
STATE = HangerState(300e3, 1e5, 1e5, 1e5, 1e5)


def _shift(turnbuckle: Turnbuckle) -> tuple[np.ndarray, np.ndarray]:
    """By elements, and by the Rayleigh-Ritz method."""
    hanger = replace(BAR, turnbuckles=(turnbuckle,))
    plain, moved = (natural_frequencies(each, STATE, 8)[0] for each in (BAR, hanger))
    return np.log(moved / plain), turnbuckle_shift(hanger)[:8]


def test_a_heavy_coupler_lowers_the_orders_that_move_there_by_up_to_a_tenth() -> None:
    exact, estimated = _shift(Turnbuckle(1.4, 0.45, 40.0, 1.28e5))
    assert exact.min() < -0.04
    assert np.abs(estimated - exact).max() < 0.01


def test_a_stiff_coupler_raises_the_orders_that_bend_there() -> None:
    exact, estimated = _shift(Turnbuckle(1.4, 0.45, 22.1 * 0.45, 1.28e6))
    assert exact.max() > 0.01
    assert np.abs(estimated - exact).max() < 0.012
