"""Nothing bad gets through to an identifier, and all that is left out is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput, NotIdentifiable
from shm.identify import Dropped, IdentifyOptions, identify
from shm.identify.measuring.setups import measure_recordings, measure_set_ups
from shm.values import Channel, Recording
from tests.identify.planted import with_samples
from tests.identify.signals import BIAXIAL, Sensor, half_sine, hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
RECORD = recording(hanger_modes(), noise=0.01)
SLOT = 8 * 1024


def _channels(record: Recording, *channels: Channel) -> Recording:
    return replace(record, channels=channels)


def test_a_not_a_number_sample_of_the_force_drops_its_hit_alone() -> None:
    record = with_samples("force", slice(SLOT + 4000, SLOT + 4001), np.nan, RECORD)
    measurement = measure_recordings([record], OPTIONS)[0]
    assert [hit.used for hit in measurement.hits] == [True, False, True, True, True]
    assert measurement.hits[1].reason == "not-a-number samples"
    assert measurement.dropped == (Dropped("hits", 1, "not-a-number samples"),)
    assert all(np.isfinite(decay).all() for decay in measurement.decays)


@pytest.mark.parametrize("late", [4000, 500])
def test_a_gap_of_one_channel_ends_the_ring_down_or_drops_its_hit(late: int) -> None:
    record = with_samples("acc_2", slice(SLOT + late, SLOT + late + 1), np.nan, RECORD)
    measurement = measure_recordings([record], OPTIONS)[0]
    whole = late == 4000
    assert [hit.used for hit in measurement.hits] == [True, whole, True, True, True]
    told = measurement.hits[1].cut if whole else measurement.hits[1].reason
    assert told == "not-a-number samples"
    assert all(np.isfinite(decay).all() for decay in measurement.decays)


def test_a_channel_that_is_mostly_not_a_number_is_dropped_instead_of_the_hits() -> None:
    record = with_samples("acc_1", slice(0, 4 * SLOT), np.nan, RECORD)
    measurement = measure_recordings([record], OPTIONS)[0]
    assert [point.name for point in measurement.points] == ["acc_2"]
    assert sum(hit.used for hit in measurement.hits) == 5
    assert measurement.dropped[0].what == "channel acc_1"


@pytest.mark.parametrize(
    ("record", "reason"),
    [
        (with_samples("acc_2", slice(None), 0.07, RECORD), "never changes"),
        (recording(hanger_modes(), (BIAXIAL[0], Sensor(None, 2.0))), "plane"),
    ],
)
def test_a_dead_channel_and_one_without_plane_among_others_are_dropped(
    record: Recording, reason: str
) -> None:
    (dropped,) = measure_recordings([record], OPTIONS)[0].dropped
    assert dropped.what == "channel acc_2"
    assert reason in dropped.reason


def test_no_usable_hit_is_not_identifiable_and_says_why() -> None:
    record = with_samples("acc_1", slice(0, 5 * SLOT), np.nan, RECORD)
    record = with_samples("acc_2", slice(0, 5 * SLOT), np.nan, record)
    with pytest.raises(NotIdentifiable, match="not-a-number"):
        measure_recordings([record], OPTIONS)[0]
    silent = with_samples("force", slice(0, 5 * SLOT), 0.0, RECORD)
    with pytest.raises(NotIdentifiable, match="no hammer hit") as caught:
        measure_recordings([silent], OPTIONS)[0]
    assert (caught.value.file, caught.value.channel) == ("test.csv", "force")
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("records", "high_hz", "words"),
    [
        ([RECORD, _channels(RECORD, *RECORD.accelerations)], 50.0, "no force channel"),
        ([_channels(RECORD, RECORD.channels[0])], 50.0, "no acceleration channel"),
        ([RECORD], 600.0, "too slow"),
        ([RECORD, recording(hanger_modes(), rate_hz=2048.0)], 50.0, "sampling rate differs"),
        ([replace(RECORD, sampling_rate_hz=1e12)], 50.0, "at 1e\\+12 Hz, less than any mode"),
    ],
)
def test_records_that_cannot_be_used_together_are_refused(
    records: list[Recording], high_hz: float, words: str
) -> None:
    with pytest.raises(BadInput, match=words) as caught:
        measure_set_ups(records, IdentifyOptions(2.0, high_hz))
    assert "channel" not in words or "N for the hammer" in caught.value.remedy


def test_rates_read_off_rounded_times_are_one_rate() -> None:
    rounded = replace(RECORD, sampling_rate_hz=RECORD.sampling_rate_hz * (1 + 1e-7))
    (measurement,) = measure_set_ups([RECORD, rounded], OPTIONS)
    assert len(measurement.decays) == 2 * len(measure_set_ups([RECORD], OPTIONS)[0].decays)


def test_a_ring_down_is_used_from_where_it_is_no_longer_clipped() -> None:
    """A clipped signal still says how a mode decays, later."""
    limit = 0.15 * float(np.abs(RECORD.channels[1].values).max())  # of a ring-down's 0.21 or more
    clipped = [
        replace(c, values=np.clip(c.values, -limit, limit), full_scale=limit)
        if c.name == "acc_1"
        else c
        for c in RECORD.channels
    ]
    record = _channels(RECORD, *clipped)
    measurement = measure_recordings([record], OPTIONS)[0]
    assert all(hit.used for hit in measurement.hits)
    assert {hit.cut for hit in measurement.hits} == {"clipped acceleration: acc_1"}
    found, sound = (identify([each], OPTIONS, test_id="t").test for each in (record, RECORD))
    assert len(found.modes) == len(sound.modes)
    for mode, true in zip(found.modes, sound.modes, strict=True):
        assert mode.damping_ratio == pytest.approx(true.damping_ratio, rel=0.05)


def test_double_hits_are_used_from_after_the_second_blow() -> None:
    force = RECORD.channels[0].values.copy()
    for hit in (1, 2, 3):
        begin = hit * SLOT + 307 + 60
        force[begin : begin + 4] += half_sine(1024.0, 600.0)
    record = _channels(RECORD, replace(RECORD.channels[0], values=force), *RECORD.channels[1:])
    measurement = measure_recordings([record], OPTIONS)[0]
    assert [hit.cut for hit in measurement.hits] == [
        "",
        "double hit",
        "double hit",
        "double hit",
        "",
    ]
    assert all(hit.used for hit in measurement.hits)
    assert measurement.decays[1].shape[1] < measurement.decays[0].shape[1]
