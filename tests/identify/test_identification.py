"""From simulated recordings of a hanger to its modes: the whole room."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from shm.documents import dump
from shm.errors import BadInput, NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.modes_document import modes_document, parse_modes
from shm.simulate import HammerPlan, HangerState
from shm.values import PLANES, FrequencyResponse, Hanger, Recording, ResponsePoint
from tests.identify.signals import BIAXIAL, Planted, hanger_modes, recording
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


def test_what_the_modes_make_of_the_response_follows_it(identified: Identification) -> None:
    response, fit = identified.frequency_response, identified.fit
    band = (response.frequency_hz > 3) & (response.frequency_hz < 89)
    left = np.linalg.norm((response.accelerance - fit)[:, band])
    assert left < 0.2 * np.linalg.norm(response.accelerance[:, band])


def test_amplitude_is_the_hit_level_over_the_reference_level() -> None:
    options = replace(OPTIONS, reference_force_n=1000.0)
    result = identify([recording(hanger_modes(), noise=0.01)], options, test_id="t")
    forces = [hit.peak_force_n for hit in result.hits]
    assert result.test.amplitude == pytest.approx(np.median(forces) / 1000.0)


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


def test_a_recording_of_noise_is_not_identifiable_and_says_why() -> None:
    rng = np.random.default_rng(5)
    record = recording([Planted(6.0, 0.9, (0.0, 0.0))], BIAXIAL)
    noise = [replace(c, values=rng.standard_normal(len(c.values))) for c in record.accelerations]
    record = replace(record, channels=(record.channels[0], *noise))
    with pytest.raises(NotIdentifiable, match="than the noise") as caught:
        identify([record], OPTIONS, test_id="t")
    assert caught.value.file == "test.csv"
    assert caught.value.remedy


def test_identify_looks_up_to_what_a_logger_passes() -> None:
    """Above 0.4 of the rate a mode may be the image of a faster one."""
    slow = _test_recording(plan=replace(PLAN, sampling_rate_hz=200.0))
    result = identify([slow], IdentifyOptions(2.0, 100.0), test_id="t", hanger=HANGER)
    assert result.band_hz == (2.0, 80.0)
    assert any("up to 80 Hz" in note for note in result.notes)
    highest = max(mode.frequency_hz for mode in result.test.modes)
    assert 70 < highest < 80


def test_no_record_and_mixed_records_are_refused() -> None:
    with pytest.raises(BadInput, match="no record"):
        identify([], OPTIONS, test_id="t")
    response = FrequencyResponse(
        "r", (ResponsePoint("a"),), np.arange(100.0), np.ones((1, 100), complex)
    )
    with pytest.raises(BadInput, match="together"):
        identify([_test_recording(), response], OPTIONS, test_id="t")
