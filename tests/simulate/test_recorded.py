"""Campaigns in the time domain: the same truth, all conditions, and the planted modes come back."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.errors import UsageError
from shm.identify import identify
from shm.identify.options import campaign_options
from shm.read import read
from shm.read.registry import write_single
from shm.settings import Settings
from shm.simulate import HangerState, PlantedEffect
from shm.values import Hanger, ModalTest, Recording, Scatter
from tests.worlds.simulated.campaign import CampaignPlan, campaign_with_truth
from tests.worlds.simulated.reality import Reality
from tests.worlds.simulated.recorded import RecordedCampaign, Recorder, recorded

STATE = HangerState(711e3)
CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 3.4})
CLOCK = PlantedEffect("timebase", "all tests", {"clock_error": 0.01})
ONE_PLANE = CampaignPlan(
    planes=("transverse",),
    shapes=False,
    temperatures_c=(4.0,),
    amplitudes=(1.0,),
    mass_share=0.0,
)
SHORT = Recorder(hits=3, samples_a_hit=640)


def made(
    hanger: Hanger, plan: CampaignPlan, *effects: PlantedEffect, recorder: Recorder = SHORT
) -> RecordedCampaign:
    return recorded(hanger, STATE, effects, plan, recorder, np.random.default_rng(3))


def identified(campaign: RecordedCampaign, hanger: Hanger, index: int = 0) -> ModalTest:
    records = campaign.tests[index].recordings
    options = campaign_options(records)
    return identify(records, options, test_id=campaign.tests[index].id, hanger=hanger).test


def test_the_truth_is_that_of_the_modal_campaign_of_the_same_generator(hanger: Hanger) -> None:
    for plan in (ONE_PLANE, replace(ONE_PLANE, reality=Reality())):
        modal = campaign_with_truth(hanger, STATE, (CLAMP,), plan, np.random.default_rng(3))
        assert made(hanger, plan, CLAMP).truth == modal.truth


def test_both_planes_of_a_round_bar_come_back_with_order_and_shape(hanger: Hanger) -> None:
    """Its planes have equal frequencies: its shapes' direction is as unsure as they say."""
    plan = CampaignPlan(temperatures_c=(4.0,), amplitudes=(2.0,), mass_share=0.0)
    hanger = replace(hanger, scatter=Scatter(0.005, 0.005, 0.005, 0.005))
    campaign = made(hanger, plan, CLAMP, recorder=Recorder())
    found = {(mode.plane, mode.order): mode for mode in identified(campaign, hanger).modes}
    errors = []
    for true in campaign.truth.frequencies:
        mode = found[true.plane, true.order]
        errors.append((mode.frequency_hz - true.frequency_hz) / mode.frequency_sd_hz)
        assert max(abs(point.cross) / point.sd for point in mode.shape) < 3
        assert max(abs(point.cross) for point in mode.shape) < 0.1
        assert max(abs(point.value) for point in mode.shape) == pytest.approx(1)
    assert len(errors) == 16
    assert np.abs(errors).max() < 4
    assert np.mean(np.square(errors)) < 2.2


def test_temperature_level_and_known_mass_arrive_in_the_modal_tests(hanger: Hanger) -> None:
    plan = replace(
        ONE_PLANE, temperatures_c=(4.0, 9.0), amplitudes=(1.0, 2.0), mass_share=0.02, modes=3
    )
    campaign = made(hanger, plan)
    for index, test in enumerate(plan.tests(hanger)):
        found = identified(campaign, hanger, index)
        assert found.id == test.id
        assert found.temperature_c == test.temperature_c
        assert found.amplitude == pytest.approx(test.amplitude, rel=0.05)
        assert found.added_mass == test.added_mass


def test_without_shapes_nobody_says_where_the_sensor_is(hanger: Hanger) -> None:
    campaign = made(hanger, ONE_PLANE)
    (record,) = campaign.recordings
    assert [channel.name for channel in record.channels] == ["force", "acc_1", "acc_2"]
    assert all(math.isnan(channel.x_m) for channel in record.accelerations)
    assert all(mode.shape == () for mode in identified(campaign, hanger).modes)


def test_recordings_tell_nothing_of_what_is_planted(hanger: Hanger, tmp_path: Path) -> None:
    """Same names, same stated rate, same size, with a wrong clock and without."""
    sizes, stated = set(), set()
    for number, effects in enumerate(((), (CLOCK,), (CLAMP,))):
        (record,) = made(hanger, ONE_PLANE, *effects).recordings
        path = tmp_path / f"{number}.npz"
        write_single(record, path)
        sizes.add(path.stat().st_size)
        stated.add((record.sampling_rate_hz, record.samples, record.temperature_c, record.source))
    assert len(sizes) == len(stated) == 1


def test_a_file_of_single_precision_gives_the_recording_back(
    hanger: Hanger, tmp_path: Path
) -> None:
    (record,) = made(hanger, ONE_PLANE).recordings
    write_single(record, tmp_path / "t1.npz")
    again = read(tmp_path / "t1.npz")
    assert isinstance(again, Recording)
    assert again.channels[0].plane == "transverse"
    assert again.sampling_rate_hz == record.sampling_rate_hz
    for old, new in zip(record.channels, again.channels, strict=True):
        np.testing.assert_array_equal(old.values, new.values)
    size = (tmp_path / "t1.npz").stat().st_size
    assert size == pytest.approx(4 * 3 * record.samples, rel=0.5)


def test_errors_of_sensors_are_in_the_recordings(hanger: Hanger) -> None:
    plan = replace(ONE_PLANE, shapes=True)
    true = replace(plan, reality=Reality(own_laws=False, section_sd=0.0))
    plain, real = (made(hanger, each).recordings[0] for each in (plan, true))
    gains = [
        np.linalg.norm(b.values) / np.linalg.norm(a.values)
        for a, b in zip(plain.accelerations, real.accelerations, strict=True)
        if a.plane == "transverse"
    ]
    assert [c.x_m for c in plain.accelerations] == [c.x_m for c in real.accelerations]
    assert 0.001 < np.std(gains) < 0.05


def test_two_planes_need_sensors_of_both(hanger: Hanger) -> None:
    with pytest.raises(UsageError, match="biaxial"):
        made(hanger, CampaignPlan(biaxial=False))


def test_a_hit_of_level_one_is_one_of_the_usual_settings() -> None:
    usual = Settings().reference_force_n
    options = campaign_options([Recording("made.csv", (), 256.0)])
    assert Recorder().reference_force_n == options.reference_force_n == usual
