"""Tests in which the sensor or the hammer went along a simulated hanger, against its shapes."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from shm.errors import BadInput, NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.simulate import HammerPlan, HangerState
from shm.values import PLANES, Hanger, Mode, Plane, Recording
from tests.identify.signals import hanger_modes, recording
from tests.worlds.simulated.elements import plane_modes
from tests.worlds.simulated.hammer import hammer_test

HANGER = Hanger(3, 12.0, 200e9, 0.002827, 6.36e-7, 22.05, 450e3)
STATE = HangerState(450e3, 3e5, 1e5, 2e6, 5e5, damping_ratio=0.002)
PLAN = HammerPlan(hits=3, seconds_per_hit=6.0, sampling_rate_hz=256.0)
OPTIONS = IdentifyOptions(2.0, 32.0)
PLACES = (1.1, 2.3, 3.7, 5.2)


def _recording(number: int, plan: HammerPlan, plane: Plane | None = None) -> Recording:
    record = hammer_test(
        HANGER,
        STATE,
        plan,
        np.random.default_rng(number),
        time=datetime(2026, 5, 1, 12 - number, tzinfo=UTC),
        temperature_c=10.0 + number,
        source=f"part{number}",
    )
    if plane is None:
        return record
    return replace(record, channels=tuple(c for c in record.channels if c.plane in (None, plane)))


def _identified(records: list[Recording]) -> Identification:
    return identify(records, OPTIONS, test_id="t", hanger=HANGER)


def _likeness(mode: Mode) -> float:
    """MAC of an identified shape and the simulator's at the same places."""
    position = np.array([point.x_m for point in mode.shape])
    found = np.array([point.value for point in mode.shape])
    planted = plane_modes(HANGER, STATE, mode.plane, 20).at(position)[:, mode.order - 1]
    return float((found @ planted) ** 2 / (found @ found) / (planted @ planted))


def _check(result: Identification, planes: list[Plane]) -> None:
    assert [(m.plane, m.order) for m in result.test.modes] == [
        (plane, order) for plane in planes for order in (1, 2, 3, 4)
    ]
    for mode in result.test.modes:
        omega = plane_modes(HANGER, STATE, mode.plane, 20).angular_frequency_rad_s
        assert mode.frequency_hz == pytest.approx(omega[mode.order - 1] / 2 / np.pi, rel=2e-4)
        assert mode.damping_ratio == pytest.approx(0.002, rel=0.1)
        assert [point.x_m for point in mode.shape] == pytest.approx(PLACES)
        assert _likeness(mode) > 0.99, (mode.plane, mode.order)


@pytest.fixture(scope="module")
def roving_sensor() -> Identification:
    plans = [replace(PLAN, sensors_x_m=(place,)) for place in PLACES]
    return _identified([_recording(*pair) for pair in enumerate(plans)])


@pytest.fixture(scope="module")
def roving_hammer() -> Identification:
    """Return a single-axis sensor stays; transverse hits, the hammer's direction stated."""
    plans = [
        replace(PLAN, sensors_x_m=(1.7,), hammer_x_m=place, hammer_angle_deg=0.0)
        for place in PLACES
    ]
    records = [_recording(number, plan, "transverse") for number, plan in enumerate(plans)]
    return _identified(
        [
            replace(r, channels=(replace(r.channels[0], plane="transverse"), *r.channels[1:]))
            for r in records
        ]
    )


def test_shapes_of_a_roving_sensor_are_joined_by_the_force(roving_sensor: Identification) -> None:
    _check(roving_sensor, ["transverse", "longitudinal"])
    assert any("4 set-ups" in note for note in roving_sensor.notes)


def test_shapes_of_a_roving_hammer_stand_where_it_hit(roving_hammer: Identification) -> None:
    _check(roving_hammer, ["transverse"])
    assert any("reciprocity" in note for note in roving_hammer.notes)


def test_a_hammer_of_unknown_direction_takes_planes_from_a_biaxial_sensor() -> None:
    plans = [replace(PLAN, hits=1, sensors_x_m=(1.7,), hammer_x_m=place) for place in PLACES]
    result = _identified([_recording(*pair) for pair in enumerate(plans)])
    _check(result, ["transverse", "longitudinal"])
    # One hit a set-up: the scatter of the four tells what is known.
    assert all(0 < m.frequency_sd_hz < 1e-3 * m.frequency_hz for m in result.test.modes)
    assert all(m.damping_sd > 0 for m in result.test.modes)
    assert all(np.isnan(point.sd) for m in result.test.modes for point in m.shape)


def test_errors_are_of_the_size_of_the_standard_deviations(roving_sensor: Identification) -> None:
    z = []
    for mode in roving_sensor.test.modes:
        omega = plane_modes(HANGER, STATE, mode.plane, 20).angular_frequency_rad_s
        truth = omega[mode.order - 1] / 2 / np.pi
        z.append((mode.frequency_hz - truth) / mode.frequency_sd_hz)
        assert 0 < mode.damping_sd < 1e-4
        assert all(0 < point.sd < 0.05 for point in mode.shape)
    assert 0.05 < np.median(np.abs(z)) < 2.0


def test_all_points_have_a_measured_response_and_what_the_modes_make_of_it(
    roving_sensor: Identification, roving_hammer: Identification
) -> None:
    for result, points in ((roving_sensor, 8), (roving_hammer, 4)):
        response, fit = result.frequency_response, result.fit
        assert response is not None
        assert fit is not None
        assert response.accelerance.shape == fit.shape == (points, len(response.frequency_hz))
        assert sorted({point.x_m for point in response.points}) == pytest.approx(PLACES)
        band = (response.frequency_hz > 3) & (response.frequency_hz < 31)
        left = (response.accelerance - fit)[:, band]
        assert np.linalg.norm(left) < 0.1 * np.linalg.norm(response.accelerance[:, band])


def _one_plane_at_a_time(hits: int) -> list[Recording]:
    """Return a biaxial sensor; the first record is hit transversely, the second longitudinally."""
    records: list[Recording] = []
    for number, plane in enumerate(PLANES):
        modes = [
            replace(mode, drive=mode.drive * (abs(mode.shape[number]) > 0.5))
            for mode in hanger_modes(5.0)
        ]
        record = recording(modes, hits=hits, seconds=6.0, rate_hz=256.0, noise=0.01, seed=number)
        force = replace(record.channels[0], plane=plane)
        records.append(replace(record, channels=(force, *record.channels[1:])))
    return records


def test_a_mode_that_one_set_up_alone_has_proven_is_kept() -> None:
    modes = identify(_one_plane_at_a_time(hits=3), OPTIONS, test_id="t").test.modes
    assert [(mode.plane, round(mode.frequency_hz, 1)) for mode in modes] == [
        ("transverse", 6.0),
        ("transverse", 13.5),
        ("transverse", 23.0),
        ("longitudinal", 6.2),
        ("longitudinal", 13.7),
        ("longitudinal", 23.1),
    ]


def test_a_mode_that_one_set_up_alone_has_seen_in_two_hits_is_dropped() -> None:
    with pytest.raises(NotIdentifiable, match="seen in one set-up only"):
        identify(_one_plane_at_a_time(hits=2), OPTIONS, test_id="t")


def test_set_ups_without_a_common_place_are_refused() -> None:
    plans = [replace(PLAN, hits=1, sensors_x_m=(x,), hammer_x_m=x + 1) for x in (1.1, 2.3)]
    with pytest.raises(BadInput, match="share neither") as caught:
        _identified([_recording(*pair) for pair in enumerate(plans)])
    assert "one sensor where it is" in caught.value.remedy
