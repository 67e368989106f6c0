"""From simulated recordings of a hanger to its modes: the whole room."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

import shm.identify
from shm.documents import dump
from shm.errors import BadInput, NotIdentifiable
from shm.identify import IDENTIFIERS, Identification, IdentifyOptions, identify
from shm.modes_document import modes_document, parse_modes
from shm.simulate import HammerPlan, HangerState
from shm.values import PLANES, FrequencyResponse, Hanger, Recording, ResponsePoint
from tests.identify.signals import BIAXIAL, Planted, Sensor, hanger_modes, recording
from tests.worlds.simulated.elements import natural_frequencies
from tests.worlds.simulated.hammer import hammer_test

# A rod 60 mm thick, 12 m long: f1 about 6 Hz, twelve modes a plane below 100 Hz.
HANGER = Hanger(3, 12.0, 200e9, 0.002827, 6.36e-7, 22.05, 450e3)
STATE = HangerState(450e3, 3e5, 1e5, 2e6, 5e5, damping_ratio=0.002)
PLAN = HammerPlan(seconds_per_hit=12.0, sampling_rate_hz=512.0)
OPTIONS = IdentifyOptions(2.0, 90.0)


def _test_recording(
    seed: int = 0, plan: HammerPlan = PLAN, state: HangerState = STATE
) -> Recording:
    return hammer_test(
        HANGER,
        state,
        plan,
        np.random.default_rng(seed),
        time=datetime(2026, 5, 1, tzinfo=UTC),
        temperature_c=12.5,
    )


@pytest.fixture(scope="module")
def identified() -> Identification:
    return identify([_test_recording()], OPTIONS, test_id="t1", hanger=HANGER)


def test_all_modes_of_both_planes_are_found_with_plane_and_order(
    identified: Identification,
) -> None:
    truth = natural_frequencies(HANGER, STATE, 20)
    expected = [
        (plane, order, frequency)
        for plane, row in zip(PLANES, truth, strict=True)
        for order, frequency in enumerate(row, 1)
        if frequency < 90
    ]
    found = [(mode.plane, mode.order) for mode in identified.test.modes]
    assert found == [(plane, order) for plane, order, _ in expected]
    for mode, (_, _, frequency) in zip(identified.test.modes, expected, strict=True):
        assert mode.frequency_hz == pytest.approx(frequency, rel=2e-4)
        assert mode.damping_ratio == pytest.approx(0.002, rel=0.1)


def test_errors_are_of_the_size_of_the_standard_deviations(identified: Identification) -> None:
    truth = natural_frequencies(HANGER, STATE, 20)
    z = [
        (m.frequency_hz - truth[PLANES.index(m.plane), m.order - 1]) / m.frequency_sd_hz
        for m in identified.test.modes
    ]
    assert 0.4 < 1.4826 * np.median(np.abs(z)) < 1.6


def test_shapes_stand_at_the_sensors_with_the_other_plane_beside(
    identified: Identification,
) -> None:
    for mode in identified.test.modes:
        assert [point.x_m for point in mode.shape] == pytest.approx([2.52, 4.44])
        assert max(abs(point.value) for point in mode.shape) == pytest.approx(1.0)
        assert all(abs(point.cross) < 0.2 for point in mode.shape)
        assert all(point.sd < 0.1 for point in mode.shape)


def test_hanger_time_and_temperature_come_with_the_test(identified: Identification) -> None:
    test = identified.test
    assert (test.id, test.hanger, test.temperature_c) == ("t1", 3, 12.5)
    assert test.time == datetime(2026, 5, 1, tzinfo=UTC)
    assert np.isnan(test.amplitude)


def test_the_result_is_a_valid_modes_document(identified: Identification) -> None:
    (back,) = parse_modes(json.loads(dump(modes_document([identified.test]))))
    assert [(m.plane, m.order) for m in back.modes] == [
        (m.plane, m.order) for m in identified.test.modes
    ]


def test_a_name_that_cannot_be_printed_makes_a_document_that_can_be_read() -> None:
    record = recording(hanger_modes(), noise=0.02, hits=4)
    found = identify([record], OPTIONS, test_id="two\nlines \u202e" + "x" * 300).test
    assert found.id.startswith("two_lines _xxx")
    (again,) = parse_modes(json.loads(dump(modes_document([found]))))
    assert again.id == found.id


def test_the_response_peaks_at_the_modes(identified: Identification) -> None:
    response = identified.frequency_response
    assert response.accelerance.shape == (4, len(response.frequency_hz))
    gain = np.abs(response.accelerance).max(axis=0)
    for mode in identified.test.modes:
        at = round(mode.frequency_hz / response.frequency_hz[1])
        away = round(0.06 * at)
        assert gain[at - 2 : at + 3].max() > 2 * min(gain[at - away], gain[at + away])


def test_everything_dropped_is_counted_with_a_reason(identified: Identification) -> None:
    assert all(entry.count > 0 and entry.reason for entry in identified.dropped)
    assert {entry.what for entry in identified.dropped} >= {"poles"}
    assert len(identified.hits) == 5


def test_each_mode_knows_how_hard_it_rang(identified: Identification) -> None:
    """A hit of about 5 N s on modal masses of about 130 kg: metres a second squared."""
    assert all(0.1 < mode.acceleration_m_s2 < 50 for mode in identified.test.modes)


def test_what_the_modes_make_of_the_response_follows_it(identified: Identification) -> None:
    response, fit = identified.frequency_response, identified.fit
    band = (response.frequency_hz > 3) & (response.frequency_hz < 89)
    left = np.linalg.norm((response.accelerance - fit)[:, band])
    assert left < 0.2 * np.linalg.norm(response.accelerance[:, band])


def test_a_second_identifier_is_asked_and_compared() -> None:
    record = recording(hanger_modes(), noise=0.01, seconds=4.0)
    result = identify([record], replace(OPTIONS, cross_check="ssi"), test_id="t")
    (check,) = [entry for entry in result.quality if entry.name == "cross-check"]
    assert check.verdict == "good"
    assert check.value == 0.0


def test_amplitude_is_the_hit_level_over_the_reference_level() -> None:
    options = replace(OPTIONS, reference_force_n=1000.0)
    result = identify([recording(hanger_modes(), noise=0.01)], options, test_id="t")
    forces = [hit.peak_force_n for hit in result.hits]
    assert result.test.amplitude == pytest.approx(np.median(forces) / 1000.0)


def test_hits_in_several_files_are_one_test() -> None:
    whole = identify([recording(hanger_modes(), noise=0.02, hits=4)], OPTIONS, test_id="t")
    parts = [recording(hanger_modes(), noise=0.02, hits=1, seed=seed) for seed in range(4)]
    split = identify(parts, OPTIONS, test_id="t")
    assert len(split.hits) == 4
    for one, other in zip(whole.test.modes, split.test.modes, strict=True):
        assert (one.plane, one.order) == (other.plane, other.order)
        assert one.frequency_hz == pytest.approx(other.frequency_hz, rel=5e-4)


def test_a_mode_at_whose_node_the_sensor_sits_does_not_shift_the_rest() -> None:
    """At a third of a pinned hanger, orders 3, 6, 9 do not show."""
    state = HangerState(450e3, 0.0, 0.0, 0.0, 0.0, damping_ratio=0.002)
    plan = replace(PLAN, sensors_x_m=(4.0,), hammer_angle_deg=0.0)
    result = identify([_test_recording(1, plan, state)], OPTIONS, test_id="t", hanger=HANGER)
    truth = natural_frequencies(HANGER, state, 20)[0]
    orders = [mode.order for mode in result.test.modes]
    assert 3 not in orders
    assert {1, 2, 4, 5, 7, 8} <= set(orders)
    for mode in result.test.modes:
        assert mode.frequency_hz == pytest.approx(truth[mode.order - 1], rel=5e-4)
    assert any("order 3" in note for note in result.notes)


def test_without_a_stated_plane_all_is_transverse_and_a_note_says_so() -> None:
    planted = [Planted(f, 0.003, (1.0,)) for f in (6.0, 13.5, 23.0)]
    result = identify([recording(planted, (Sensor(None),))], OPTIONS, test_id="t")
    assert [(m.plane, m.order) for m in result.test.modes] == [
        ("transverse", 1),
        ("transverse", 2),
        ("transverse", 3),
    ]
    assert any("plane" in note for note in result.notes)


def test_a_sensor_that_sees_both_planes_along_one_axis_is_warned_of() -> None:
    """Two modes 1 % apart in what is said to be one plane: only a biaxial sensor can tell."""
    planted = [Planted(f, 0.002, (1.0,)) for f in (6.0, 13.5, 23.0, 23.23)]
    result = identify([recording(planted, (Sensor(),), noise=0.01)], OPTIONS, test_id="t")
    (check,) = [check for check in result.quality if check.name == "numbering"]
    assert check.verdict == "warning"
    # Nobody described a hanger: they are counted.
    assert [mode.order for mode in result.test.modes] == [1, 2, 3, 4]


@pytest.mark.parametrize(("hits", "noted"), [(2, True), (3, False)])
def test_fewer_than_three_hits_are_noted(hits: int, noted: bool) -> None:
    result = identify([recording(hanger_modes(), hits=hits, noise=0.01)], OPTIONS, test_id="t")
    assert any("fewer than three hits" in note for note in result.notes) is noted


def test_a_recording_of_noise_is_not_identifiable_and_says_why() -> None:
    rng = np.random.default_rng(5)
    record = recording([Planted(6.0, 0.9, (0.0, 0.0))], BIAXIAL)
    noise = [replace(c, values=rng.standard_normal(len(c.values))) for c in record.accelerations]
    record = replace(record, channels=(record.channels[0], *noise))
    with pytest.raises(NotIdentifiable, match="than the noise") as caught:
        identify([record], OPTIONS, test_id="t")
    assert caught.value.file == "test.csv"
    assert caught.value.remedy


def test_no_record_and_mixed_records_are_refused() -> None:
    with pytest.raises(BadInput, match="no record"):
        identify([], OPTIONS, test_id="t")
    response = FrequencyResponse(
        "r", (ResponsePoint("a"),), np.arange(100.0), np.ones((1, 100), complex)
    )
    with pytest.raises(BadInput, match="together"):
        identify([_test_recording(), response], OPTIONS, test_id="t")


def test_the_public_surface_is_what_is_stated() -> None:
    assert set(shm.identify.__all__) == {
        "IDENTIFIERS", "Dropped", "Hit", "Identification", "IdentifyOptions", "Poles", "identify",
    }  # fmt: skip
    assert "ssi" in IDENTIFIERS
