"""Orders by a fitted bar: of the pattern's own frequencies, the lowest missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.mode_ordering.alignment import (
    PlaneModes,
    log_frequency,
    tensioned_beam_pattern,
)
from shm.identify.mode_ordering.bar_fit import borne_out, described_orders
from shm.identify.mode_ordering.order import LEAST_MARGIN, Expected, Numbering, assign_orders

LONG = Expected(log_unit=float(np.log(0.05)), log_xi=float(np.log(35.0)))
FIXITIES = (0.8, 0.6)


def _planes(orders: Sequence[Sequence[int]], off: float = 0.0) -> list[PlaneModes]:
    """Modes of a bar 5 % tighter than described; `off` lifts every other one, as a fraction."""
    planes = []
    for each, fixity in zip(orders, FIXITIES, strict=True):
        order = np.array(each, float)
        log_hz = LONG.log_unit + log_frequency(
            LONG.log_xi + 0.025, np.full(order.shape, fixity), order
        )
        planes.append(PlaneModes(np.exp(log_hz) * (1 + off * (np.arange(len(order)) % 2))))
    return planes


def _least_margin(numbering: Numbering) -> float:
    return min(margin for own in numbering.margins for margin in own)


def test_a_bar_numbers_high_orders_that_the_grid_leaves_open() -> None:
    orders = (tuple(range(6, 16)), tuple(range(7, 14)))
    planes = _planes(orders)
    given = assign_orders(planes, LONG)
    found = borne_out(planes, LONG, given)
    assert _least_margin(given) < LEAST_MARGIN < _least_margin(found)
    assert found.orders == orders


def test_it_does_so_from_orders_that_are_several_too_low_and_in_one_plane() -> None:
    orders = (tuple(range(6, 16)), ())
    planes = _planes(orders)
    low = replace(
        assign_orders(planes, LONG), orders=(tuple(range(3, 13)), ()), margins=((0.0,) * 10, ())
    )
    assert borne_out(planes, LONG, low).orders == orders


def test_a_hanger_that_is_no_plain_bar_keeps_its_margins() -> None:
    planes = _planes((tuple(range(6, 16)), tuple(range(7, 14))), off=0.01)
    given = assign_orders(planes, LONG)
    assert borne_out(planes, LONG, given) is given


def test_orders_that_no_frequency_tells_stay_open() -> None:
    planes = _planes((tuple(range(20, 27)), ()))
    assert _least_margin(borne_out(planes, LONG, assign_orders(planes, LONG))) < LEAST_MARGIN


def test_a_sensor_of_ten_times_the_gain_does_not_outvote_the_frequencies() -> None:
    orders = (tuple(range(5, 17)), tuple(range(7, 17)))
    place = np.array([0.028, 0.058])
    pattern = tensioned_beam_pattern()
    tension = np.array([np.argmin(np.abs(pattern.log_xi - LONG.log_xi))])
    shapes = pattern.shapes(place, tension)[0, -1] * [1.0, 10.0]
    planes = [
        replace(
            plane,
            position=place,
            shapes=shapes[np.array(own) - 1],
            shape_sd=np.full(len(own), 0.01),
        )
        for plane, own in zip(_planes(orders), orders, strict=True)
    ]
    assert borne_out(planes, LONG, assign_orders(planes, LONG)).orders != orders
    found = described_orders(planes, LONG)
    assert found.orders == orders
    assert _least_margin(found) > LEAST_MARGIN
