"""A sensor whose axes are exchanged or turned, or that is said to be off the hanger, is noticed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput, NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.contract import FoundMode
from shm.identify.quality import Inspection
from shm.identify.quality.of_sensors import DIRECTIONS, PLACES
from shm.simulate import HammerPlan, HangerState
from shm.values import NAN, PLANES, Mode, QualityCheck, Recording, ResponsePoint, ShapePoint
from tests.helpers.beam_shapes import mode_shape
from tests.helpers.hangers import HANGER_3
from tests.identify.planted import none_found
from tests.worlds.simulated.hammer import hammer_test

HANGER = replace(HANGER_3, plate=None)
PLAN = HammerPlan(
    hits=4, seconds_per_hit=8.0, sampling_rate_hz=256.0, peak_force_n=1000.0, hammer_angle_deg=40.0
)
TWO_PLACES = [ResponsePoint(f"{x_m} {plane}", plane, x_m) for x_m in (2.5, 4.0) for plane in PLANES]


@pytest.fixture(scope="module")
def record() -> Recording:
    """Of ends that differ by plane: a round bar alike in both has no axes to exchange."""
    state = HangerState(711e3, k1_n_m_rad=5e6, k3_n_m_rad=5e6)
    return hammer_test(HANGER, state, PLAN, np.random.default_rng(5))


def identified(record: Recording) -> Identification:
    return identify([record], IdentifyOptions(2.0, 60.0), test_id="t", hanger=HANGER)


def with_places(record: Recording, *places_m: float) -> Recording:
    force, *others = record.channels
    moved = [replace(c, x_m=x_m) for c, x_m in zip(others, places_m, strict=True)]
    return replace(record, channels=(force, *moved))


def test_sensors_that_agree_are_said_to(record: Recording) -> None:
    (check,) = [each for each in identified(record).quality if each.name == "directions"]
    assert check.verdict == "good"
    assert check.value < 5


def test_axes_that_are_exchanged_at_one_place_are_refused(record: Recording) -> None:
    *others, one, other = record.channels
    exchanged = (*others, replace(one, plane=other.plane), replace(other, plane=one.plane))
    with pytest.raises(NotIdentifiable, match=r"directions: .* degrees apart.*are exchanged"):
        identified(replace(record, channels=exchanged))


def test_a_place_off_the_hanger_is_refused_with_its_channel(record: Recording) -> None:
    for x_m in (-3.0, 22.0):
        with pytest.raises(BadInput, match=f"{x_m:g} m from the deck end") as raised:
            identified(with_places(record, 2.5, 2.5, x_m, x_m))
        assert raised.value.channel == "acc_3"


def check_of(name: str, record: Recording) -> QualityCheck:
    return next(check for check in identified(record).quality if check.name == name)


def test_a_sound_test_moves_as_the_described_mass_lets_it(record: Recording) -> None:
    checks = {check.name: check for check in identified(record).quality}
    gain, places = checks["gain"], checks["places"]
    assert (gain.verdict, places.verdict) == ("good", "good")
    assert gain.value == pytest.approx(1, abs=0.1)


def test_without_the_hammers_place_the_gain_is_said_to_be_unchecked(record: Recording) -> None:
    force, *others = record.channels
    check = check_of("gain", replace(record, channels=(replace(force, x_m=NAN), *others)))
    assert check.verdict == "unknown"
    assert "not checked: the hammer's place is not stated" in check.found


def test_accelerations_in_g_under_the_name_of_m_s2_are_noticed(record: Recording) -> None:
    force, *others = record.channels
    in_g = tuple(replace(c, values=c.values / 9.81) for c in others)
    check = check_of("gain", replace(record, channels=(force, *in_g)))
    assert check.verdict == "warning"
    assert check.value == pytest.approx(1 / 9.81, rel=0.1)
    assert "accelerations in g" in check.found


def shapes_at(places_m: list[float], gains: list[float], said_m: list[float]) -> list[Mode]:
    """Six modes of a hanger, seen by sensors of other gains and at other places than is said."""
    xi = HANGER.length_m * np.sqrt(HANGER.nominal_tension_n / HANGER.bending_stiffness_n_m2)
    return [
        Mode("transverse", order, 5.0 * order, shape=tuple(
            ShapePoint(x_m, float(value))
            for x_m, value in zip(
                said_m, gains * mode_shape(xi, 8, 8, order, np.array(places_m) / 12), strict=True
            )
        ))
        for order in range(1, 7)
    ]  # fmt: skip


PLACES_M = [1.2, 2.0, 3.1]


@pytest.mark.parametrize(
    ("true_m", "gains", "found"),
    [
        (PLACES_M, [1, 1, 1], "are those of the described"),
        (PLACES_M, [0.4, 1, 1], "the sensor at 1.2 m reads 2.5 times too little"),
        (PLACES_M, [1, 1, -1], "the sensor at 3.1 m reads 1 times too much with the wrong sign"),
        ([1.6, 2.0, 3.1], [1, 1, 1], "the sensor said to be at 1.2 m is at 1.6 m"),
        ([3.1, 2.0, 1.2], [1, 1, 1], "no one sensor explains it"),
    ],
)
def test_one_gain_or_place_that_is_wrong_is_named(
    true_m: list[float], gains: list[float], found: str
) -> None:
    modes = shapes_at(true_m, gains, PLACES_M)
    check = PLACES.check(Inspection([], [], IdentifyOptions(), modes=modes, hanger=HANGER))
    assert check is not None
    assert found in check.found
    assert check.verdict == ("good" if "are those" in found else "warning")


def turned(degrees: float, amplitude: float = 1.0) -> list[FoundMode]:
    """Modes of either plane, seen turned at the second place."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    shapes = [[1.0, 0.0, c, s], [0.0, 1.0, -s, c]] * 2
    scale = np.array([1.0, 1.0, amplitude, amplitude])
    return [FoundMode(f, 0.01, 0.01, 0.001, np.array(v) * scale, NAN * scale)
            for f, v in zip((3.0, 3.1, 6.0, 6.1), shapes, strict=True)]  # fmt: skip


@pytest.mark.parametrize(("degrees", "verdict"), [(3, "good"), (-30, "warning"), (88, "refused")])
def test_the_angle_between_places_decides(degrees: float, verdict: str) -> None:
    finding = none_found(*turned(degrees))
    check = DIRECTIONS.check(
        Inspection([], [], IdentifyOptions(), finding=finding, points=TWO_PLACES)
    )
    assert check is not None
    assert (check.verdict, check.value) == (verdict, pytest.approx(abs(degrees)))
