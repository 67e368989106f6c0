"""Hits in both directions at one place, identified together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.identify.contract import Measurement
from shm.identify.setup_merging.hit_directions import have_same_sensors
from shm.values import PLANES, ModalTest, Mode, Plane, Recording, ResponsePoint
from tests.identify.signals import Planted, recording

TURNED_DEG, HIT_DEG, DAMPING = 8.0, 20.0, 0.001
OPTIONS = IdentifyOptions(2.0, 50.0)


def _records(apart: float) -> list[Recording]:
    """Return records of a hanger with rotated planes, `apart` in frequency, as a fraction.

    The hits are along other directions.
    """
    records: list[Recording] = []
    for number, plane in enumerate(PLANES):
        hit_deg = HIT_DEG + 90.0 * number
        modes = [
            _mode(frequency_hz * (1 + apart * across), TURNED_DEG + 90.0 * across, hit_deg)
            for frequency_hz in (6.0, 13.5, 23.0)
            for across in (0, 1)
        ]
        made = recording(modes, hits=3, seconds=6.0, rate_hz=256.0, noise=0.003, seed=number)
        force = replace(made.channels[0], plane=plane, x_m=1.0)
        records.append(replace(made, channels=(force, *made.channels[1:])))
    return records


def _mode(frequency_hz: float, angle_deg: float, hit_deg: float) -> Planted:
    angle = math.radians(angle_deg)
    drive = math.cos(angle - math.radians(hit_deg))
    return Planted(frequency_hz, DAMPING, (math.cos(angle), math.sin(angle)), drive)


def _found(apart: float) -> ModalTest:
    return identify(_records(apart), OPTIONS, test_id="t").test


def _off_deg(mode: Mode) -> float:
    """By how much the mode is turned from the planted direction."""
    (point,) = mode.shape
    sign = 1 if mode.plane == "transverse" else -1
    return math.degrees(math.atan(sign * point.cross / point.value)) - TURNED_DEG


def _may_be_turned_deg(mode: Mode) -> float:
    return math.degrees(mode.shape[0].sd)


def test_planes_nearer_than_their_bandwidth_are_not_turned_towards_the_hammer() -> None:
    modes = _found(0.5 * 2 * DAMPING).modes
    assert len(modes) == 6
    for mode in modes:
        assert abs(_off_deg(mode)) < max(0.5, 3 * _may_be_turned_deg(mode))
        assert _may_be_turned_deg(mode) < 2


def test_planes_of_one_frequency_may_be_turned_by_anything_and_say_so() -> None:
    modes = _found(0.0).modes
    assert [(mode.plane, mode.order) for mode in modes] == [
        (plane, order) for plane in PLANES for order in (1, 2, 3)
    ]
    for mode in modes:
        assert abs(_off_deg(mode)) < 3 * _may_be_turned_deg(mode)
        assert _may_be_turned_deg(mode) > 2


def _set_up(plane: Plane | None, hammer_m: float = 1.0, hits: int = 3) -> Measurement:
    points = tuple(ResponsePoint(each, each, 2.0) for each in PLANES)
    decays = (np.zeros((2, 9)),) * hits
    return Measurement(
        "t.csv", points, decays, 100.0, None, hammer=ResponsePoint("f", plane, hammer_m)
    )


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        ([_set_up("longitudinal")], True),
        ([_set_up("transverse")], False),
        ([_set_up(None)], False),
        ([_set_up("longitudinal", hammer_m=1.5)], False),
        ([_set_up("longitudinal", hits=2)], False),
        ([], False),
    ],
)
def test_only_set_ups_that_differ_by_the_direction_of_enough_hits_are_alike(
    others: list[Measurement], expected: bool
) -> None:
    assert have_same_sensors([_set_up("transverse"), *others]) is expected
