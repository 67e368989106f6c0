"""Hangers that are drawn are hangers that are built."""

from __future__ import annotations

import numpy as np

from tests.worlds.simulated.reality import drawn_hanger


def test_drawn_hangers_keep_their_ranges_and_scatter_about_their_nominal_tension() -> None:
    off = []
    for seed in range(300):
        hanger, state = drawn_hanger(np.random.default_rng(seed))
        assert 6 <= hanger.length_m <= 15
        assert hanger.length_m == round(hanger.length_m, 1)
        assert 0.08 <= hanger.diameter_m <= 0.14
        assert 150e3 <= state.tension_n <= 900e3
        assert 0.149 < state.tension_n / (355e6 * hanger.area_m2) < 0.501
        assert hanger.nominal_tension_n % 1000 == 0
        off.append(np.log(hanger.nominal_tension_n / state.tension_n))
    assert abs(np.mean(off)) < 4 * 0.1 / np.sqrt(300)
    assert abs(np.std(off) / 0.1 - 1) < 4 / np.sqrt(600)


def test_the_same_seed_draws_the_same_hanger() -> None:
    one, same, other = (drawn_hanger(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one == same
    assert one[1] != other[1]
