from __future__ import annotations

import numpy as np
import pytest

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.planes import planes_of, shape_points
from shm.values import NAN
from tests.identify.signals import BIAXIAL, Sensor, points

TWO_PLACES = (
    Sensor("transverse", 1.0),
    Sensor("longitudinal", 1.0),
    Sensor("transverse", 2.5),
    Sensor("longitudinal", 2.5),
)


def _mode(frequency_hz: float, *shape: float) -> FoundMode:
    values = np.array(shape)
    return FoundMode(frequency_hz, 0.01, 0.002, 0.0001, values, 0.01 * np.abs(values))


def test_three_sensors_one_way_do_not_outvote_one_the_other_way() -> None:
    sensors = (*(Sensor("transverse", x) for x in (1.0, 2.0, 3.0)), Sensor("longitudinal", 2.0))
    mode = _mode(5.0, 0.65, 0.65, 0.65, 1.0)
    assert planes_of([mode], points(sensors)) == ["longitudinal"]


def test_a_mode_is_not_moved_where_the_other_plane_is_taken_or_the_shape_says_no() -> None:
    taken = [_mode(9.95, 0.1, 1.0), _mode(10.0, 1.0, 0.1), _mode(10.05, 1.0, 0.9)]
    assert planes_of(taken, points(BIAXIAL)) == ["longitudinal", "transverse", "transverse"]
    plain = [_mode(10.0, 1.0, 0.1), _mode(10.05, 1.0, 0.2)]
    assert planes_of(plain, points(BIAXIAL)) == ["transverse", "transverse"]


def test_a_shape_holds_its_plane_and_beside_it_the_other() -> None:
    shape = shape_points(_mode(5.0, 0.4, 0.02, -0.8, 0.04), "transverse", points(TWO_PLACES))
    assert [point.x_m for point in shape] == [1.0, 2.5]
    assert [point.value for point in shape] == pytest.approx([-0.5, 1.0])
    assert [point.cross for point in shape] == pytest.approx([-0.025, -0.05])
    assert [point.sd for point in shape] == pytest.approx([0.005, 0.01])


def test_a_sensor_without_position_has_no_place_in_the_shape() -> None:
    assert shape_points(_mode(5.0, 1.0), "transverse", points([Sensor(None, NAN)])) == ()


def test_twin_sensors_at_one_place_are_averaged() -> None:
    sensors = (Sensor("transverse", 1.0), Sensor("transverse", 1.0), Sensor("transverse", 2.0))
    shape = shape_points(_mode(5.0, 0.4, 0.6, 1.0), "transverse", points(sensors))
    assert [point.value for point in shape] == pytest.approx([0.5, 1.0])
