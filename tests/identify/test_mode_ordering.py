"""Planes, orders and notes of whole findings, where much is known and where little is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.placement import place_modes
from shm.values import NAN, PLANES, Hanger
from tests.identify.test_foreign import (
    COUNTED,
    HANGER,
    POINTS,
    found_at,
    hanger_modes,
    orders_of,
)


def test_missing_modes_do_not_shift_the_others_and_are_named() -> None:
    found = hanger_modes()
    kept = [mode for index, mode in enumerate(found) if index not in (0, 1, 6)]
    placement = place_modes(kept, POINTS, HANGER)
    numbers = [number for orders in orders_of(placement).values() for number in orders]
    assert len(numbers) == len(kept)
    assert min(numbers) == 2
    truth = {mode.frequency_hz: order for mode, order in _truth(found).items()}
    assert all(truth[mode.frequency_hz] == mode.order for mode in placement.modes)
    assert any("order 1" in note for note in placement.notes)


def _truth(found: list[FoundMode]) -> dict[FoundMode, int]:
    planes = {0: 0, 1: 0}
    orders: dict[FoundMode, int] = {}
    for mode in found:
        plane = int(abs(mode.shape[1]) > abs(mode.shape[0]))
        planes[plane] += 1
        orders[mode] = planes[plane]
    return orders


@pytest.mark.parametrize("factor", [0.4, 1.8])
def test_a_nominal_tension_far_off_does_not_shift_the_orders(factor: float) -> None:
    hanger = replace(HANGER, nominal_tension_n=HANGER.nominal_tension_n / factor)
    kept = hanger_modes()[4:]
    assert orders_of(place_modes(kept, POINTS, hanger)) == {p: [3, 4, 5, 6, 7] for p in PLANES}


def test_planes_turned_from_the_sensors_keep_their_modes_and_a_note_says_by_how_much() -> None:
    turned = [_turned(mode, 35.0) for mode in hanger_modes()]
    placement = place_modes(turned, POINTS, HANGER)
    assert orders_of(placement) == COUNTED
    assert any("35 degrees" in note for note in placement.notes)


def test_a_pair_that_mixes_keeps_one_mode_in_each_plane() -> None:
    """Two modes 0.05 % apart at right angles, 40 degrees off the planes."""
    found = hanger_modes()
    first, second = found[0], found[1]
    near = replace(second, frequency_hz=1.0005 * first.frequency_hz)
    mixed = [_turned(first, 40.0), _turned(near, 40.0), *found[2:]]
    assert orders_of(place_modes(mixed, POINTS, HANGER)) == COUNTED


@pytest.mark.parametrize("share", [0.12, 0.17, 0.5, 0.83, 0.88])
def test_an_unresolved_pair_has_its_order_in_both_planes_and_a_wide_deviation(share: float) -> None:
    """It has 15 % of its energy and more in its weaker plane, whichever that is."""
    found, is_pair = hanger_modes(), 0.15 < share < 0.85
    degrees = np.degrees(np.arcsin(np.sqrt(share)))
    merged = found_at(found[2].frequency_hz, found[2].shape[::2] + found[2].shape[1::2], degrees)
    placement = place_modes([*found[:2], merged, *found[4:]], POINTS, HANGER)
    assert (orders_of(placement) == COUNTED) == is_pair
    own = [mode for mode in placement.modes if mode.frequency_hz == merged.frequency_hz]
    assert [mode.order for mode in own] == [2] * (1 + is_pair)
    tenth = is_pair * 0.2 * merged.damping_ratio * merged.frequency_hz
    assert own[0].frequency_sd_hz == pytest.approx(np.hypot(tenth, merged.frequency_sd_hz))


def test_place_modes_seen_askew_stay_in_their_plane() -> None:
    """Planes 3 % apart, and a sensor's gain shows a longitudinal mode in the transverse one."""
    found = [
        replace(mode, frequency_hz=1.03 * mode.frequency_hz)
        if abs(mode.shape[1]) > abs(mode.shape[0])
        else mode
        for mode in hanger_modes()
    ]
    askew = found_at(found[3].frequency_hz, found[3].shape[1::2], 45.0)
    placement = place_modes([*found[:2], askew, *found[4:]], POINTS, HANGER)
    assert orders_of(placement) == {
        "transverse": [1, 3, 4, 5, 6, 7],
        "longitudinal": COUNTED[PLANES[1]],
    }


def test_place_modes_leaves_one_of_a_pattern_unnumbered() -> None:
    """One frequency fits some bar, and no other order by chance speaks against it."""
    placement = place_modes([found_at(91.7, np.array([0.95, 1.0, -0.88]))], POINTS, HANGER)
    assert placement.modes == ()
    assert [mode.kind for mode in placement.foreign_modes] == ["unnumbered"]


def test_without_positions_a_note_says_that_shapes_do_not_help() -> None:
    points = [replace(point, x_m=NAN) for point in POINTS]
    placement = place_modes(hanger_modes(), points, HANGER)
    assert orders_of(placement) == COUNTED
    assert any("position" in note for note in placement.notes)


def test_a_description_that_does_not_fit_is_left_out_and_a_note_says_so() -> None:
    other = Hanger(2, 4.0, 200e9, 0.00283, 6.4e-7, 22.1, 30e3)
    placement = place_modes(hanger_modes(), [replace(p, x_m=NAN) for p in POINTS], other)
    assert orders_of(placement) == COUNTED
    assert any("do not fit the hanger's description" in note for note in placement.notes)


def test_what_is_no_hanger_is_counted_and_a_note_says_so() -> None:
    found = [found_at(f, np.ones(3)) for f in (10.0, 10.9, 11.7, 12.5, 90.0)]
    placement = place_modes(found, POINTS, None)
    assert [mode.order for mode in placement.modes] == [1, 2, 3, 4, 5]
    assert any("counted" in note for note in placement.notes)


def _turned(mode: FoundMode, degrees: float) -> FoundMode:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    values = mode.shape.reshape(-1, 2) @ np.array([[cosine, sine], [-sine, cosine]])
    return replace(mode, shape=values.ravel() / np.abs(values).max())


def test_a_first_order_that_lies_above_the_others_beam_is_kept_and_said() -> None:
    first, *others = hanger_modes()
    irregular = replace(first, frequency_hz=1.2 * first.frequency_hz)
    placement = place_modes(sorted([irregular, *others], key=_hz), POINTS, HANGER)
    assert orders_of(placement) == COUNTED
    (told,) = [mode for mode in placement.modes if mode.irregular]
    assert told.frequency_hz == irregular.frequency_hz
    assert any(f"order 1, {told.frequency_hz:.2f} Hz, is well off" in n for n in placement.notes)
    assert not any(mode.irregular for mode in place_modes(hanger_modes(), POINTS, HANGER).modes)


def _hz(mode: FoundMode) -> float:
    return mode.frequency_hz
