"""Orders of modes when some are missing, on hangers by finite elements and on the measured one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify.mode_ordering.bars import Description
from shm.identify.mode_ordering.numbering import PlaneModes, number_modes
from shm.simulate import HangerState
from shm.values import Hanger
from tests.worlds.simulated.elements import natural_frequencies

HANGER = Hanger(1, 12.0, 200e9, 0.00283, 6.4e-7, 22.1, 300e3)
# Table 1.1 of the thesis on hanger 3: end plates rotated by 90 degrees bend it off the pattern.
MEASURED = (
    [5.82, 13.85, 26.17, 40.47, 59.3, 81.3],
    [6.09, 14.8, 27.0, 41.8, 61.5, 83.68],
)


def _plane(frequencies: object) -> PlaneModes:
    hz = np.array(frequencies, dtype=float)
    return PlaneModes(hz, np.zeros(len(hz)))


def _orders(planes: list[PlaneModes], hanger: Hanger | None = None) -> list[list[int]]:
    return [list(orders) for orders in number_modes(planes, hanger).orders]


def _hanger_frequencies(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    state = HangerState(300e3 * rng.uniform(0.5, 1.5), *(10 ** rng.uniform(3, 8, 4)))
    return natural_frequencies(HANGER, state, 9)


@pytest.mark.parametrize("missing", range(1, 7))
def test_a_missing_mode_of_the_measured_hanger_does_not_shift_the_others(missing: int) -> None:
    rest = [order for order in range(1, 7) if order != missing]
    one, two = MEASURED
    gappy = [one[order - 1] for order in rest]
    assert _orders([_plane(gappy), _plane(two)]) == [rest, [1, 2, 3, 4, 5, 6]]
    assert _orders([_plane(gappy), _plane([])]) == [rest, []]


def test_a_whole_hanger_is_counted() -> None:
    for seed in range(2):
        frequencies = _hanger_frequencies(seed)
        counted = list(range(1, 10))
        assert _orders([_plane(f) for f in frequencies]) == [counted, counted]


@pytest.mark.parametrize("seed", range(4))
def test_orders_missing_at_random_in_both_planes_are_left_open(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    kept = [np.sort(rng.choice(9, 7, replace=False)) for _ in range(2)]
    planes = [_plane(f[k]) for f, k in zip(_hanger_frequencies(seed), kept, strict=True)]
    assert _orders(planes) == [(k + 1).tolist() for k in kept]


def test_a_lonely_mode_is_numbered_by_the_other_plane() -> None:
    transverse, longitudinal = _hanger_frequencies(1)
    assert _orders([_plane(transverse), _plane(longitudinal[3:4])])[1] == [4]


def test_modes_of_the_deck_below_any_of_the_described_hanger_do_not_doubt_it() -> None:
    told = _round_bar(0.09, 4.0, 200e3)
    xi = np.exp(Description.of(told).log_xi)
    first_hz = float(np.exp(Description.of(told).log_unit) * np.pi * np.hypot(xi, np.pi))
    bar_hz = first_hz * np.array([1.0, 2.4, 4.4])
    deck_hz = first_hz * np.array([0.15, 0.2, 0.25, 0.3])
    found = number_modes([_plane([*deck_hz, *bar_hz]), _plane([])], told)
    alone = number_modes([_plane(bar_hz), _plane([])], told)
    assert found.basis == alone.basis == "description"
    assert found.orders[0][4:] == alone.orders[0]


def test_what_is_no_hanger_is_counted() -> None:
    frequencies = [810.0, 851.0, 900.0, 2640.0, 3008.0, 3669.0]
    assert _orders([_plane(frequencies), _plane([])]) == [[1, 2, 3, 4, 5, 6], []]


def test_more_modes_than_the_pattern_holds_are_counted() -> None:
    many = np.linspace(5, 90, 70)
    assert _orders([_plane(many)]) == [list(range(1, 71))]


def test_shapes_number_two_modes_that_frequencies_cannot() -> None:
    """A string's modes 2 and 4 look like 1 and 2 by frequency; three sensors tell."""
    position = np.array([0.1, 0.25, 0.4])
    orders = np.array([2, 4])
    shapes = np.sin(np.outer(orders, position) * np.pi)
    assert _orders([PlaneModes(5.0 * orders, np.zeros(2), position, shapes, np.zeros(2))]) == [
        [2, 4]
    ]
    assert _orders([_plane(5.0 * orders)]) == [[1, 2]]


def test_a_described_hanger_keeps_its_numbers_when_its_first_modes_are_lost() -> None:
    """Modes 1 to 3 and 7 lie in the noise: by their pattern alone the rest could be 1, 2, 3, ..."""
    area, second_moment = np.pi * 0.13**2 / 4, np.pi * 0.13**4 / 64
    hanger = Hanger(14, 21.8, 200e9, area, second_moment, 7800 * area, nominal_tension_n=711e3)
    state = HangerState(661e3, 9.3e7, 6.6e7, 1.4e7, 1.4e7)
    found = [3, 4, 5, 7, 8, 9, 10, 11]
    planes = [_plane(each[found]) for each in natural_frequencies(hanger, state, 12)]
    orders = [index + 1 for index in found]
    assert _orders(planes, hanger) == [orders, orders]
    ill_known = replace(hanger, nominal_tension_n=950e3)
    assert _orders(planes, ill_known) == [orders, orders]


def _round_bar(diameter_m: float, length_m: float, nominal_tension_n: float) -> Hanger:
    area, inertia = np.pi * diameter_m**2 / 4, np.pi * diameter_m**4 / 64
    return Hanger(1, length_m, 210e9, area, inertia, 7850 * area, nominal_tension_n)


# Bars of shm.simulate: one sags with lambda squared 7 at 851 kN, one has lost 53 % of its section
# over 2.6 m at an end, at 619 kN.
SLACK_BAR = _round_bar(0.085, 14.5, 880e3)
SAGGING = [6.556, 11.463, 18.286, 26.236, 35.537, 46.213, 58.463, 72.21]
THINNED_BAR = _round_bar(0.09, 14.1, 679e3)
THINNED = [4.97, 11.06, 18.0, 25.4, 34.59, 46.14, 58.79, 72.7]


def test_a_first_order_that_sag_raises_is_the_first() -> None:
    """Set aside, nothing would tell of the sag."""
    found = number_modes([_plane(SAGGING)], SLACK_BAR)
    assert found.orders == (tuple(range(1, 9)),)
    assert found.irregular == (True,)


def test_a_first_order_that_a_lost_section_lowers_is_the_first() -> None:
    found = number_modes([_plane(THINNED)], THINNED_BAR)
    assert found.orders == (tuple(range(1, 9)),)
    assert found.irregular == (True,)


def test_a_mode_above_the_first_order_is_not_taken_for_it() -> None:
    foreign = 6.556
    modes = [_plane([5.4, foreign, *SAGGING[1:]])]
    assert _orders(modes, SLACK_BAR) == [[1, 0, *range(2, 9)]]
