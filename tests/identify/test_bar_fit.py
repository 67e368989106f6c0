"""Orders by a fitted bar: of a bar's own frequencies, the lowest missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.mode_ordering.bars import Description, log_factor, shapes_of, solved
from shm.identify.mode_ordering.numbering import LEAST_MARGIN, PlaneModes, number_modes
from shm.values import Hanger

_AREA = np.pi * 0.08**2 / 4
LONG = Hanger(1, 25.0, 200e9, _AREA, np.pi * 0.08**4 / 64, 7850 * _AREA, nominal_tension_n=790e3)
TOLD = Description.of(LONG)
FIXITIES = (0.8, 0.6)


def _planes(orders: Sequence[Sequence[int]], off: float = 0.0) -> list[PlaneModes]:
    """Modes of a bar 5 % tighter than described; `off` lifts every other one, as a fraction."""
    planes = []
    for each, fixity in zip(orders, FIXITIES, strict=True):
        order = np.array(each, float)
        log_hz = TOLD.log_unit + log_factor(
            TOLD.log_xi + 0.025, np.full(order.shape, fixity), order
        )
        hz = np.exp(log_hz) * (1 + off * (np.arange(len(order)) % 2))
        planes.append(PlaneModes(hz, np.zeros(len(order))))
    return planes


def test_a_bar_numbers_high_orders_that_the_grid_leaves_open() -> None:
    """Bars that are none to a thousandth stay open: the grid alone does not decide these."""
    orders = (tuple(range(6, 16)), tuple(range(7, 14)))
    found = number_modes(_planes(orders), LONG)
    assert found.orders == orders
    assert found.least_margin > LEAST_MARGIN
    rough = number_modes(_planes(orders, off=0.01), LONG)
    assert rough.least_margin < LEAST_MARGIN


def test_orders_that_no_frequency_tells_stay_open() -> None:
    planes = _planes((tuple(range(20, 27)), ()))
    assert number_modes(planes, LONG).least_margin < LEAST_MARGIN


def test_a_sensor_of_ten_times_the_gain_does_not_outvote_the_frequencies() -> None:
    orders = (tuple(range(5, 17)), tuple(range(7, 17)))
    place = np.array([0.028, 0.058])
    every = np.arange(1, 20)
    xi = np.full(every.shape, np.exp(TOLD.log_xi))
    shapes = shapes_of(solved(xi, np.ones(every.shape), every), place) * [1.0, 10.0]
    planes = [
        replace(
            plane,
            position=place,
            shapes=shapes[np.array(own) - 1],
            shape_sd=np.full(len(own), 0.01),
        )
        for plane, own in zip(_planes(orders), orders, strict=True)
    ]
    found = number_modes(planes, LONG)
    assert found.orders == orders
    assert found.least_margin > LEAST_MARGIN
