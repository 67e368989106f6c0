"""Nothing bad gets through to an identifier, and all that is left out is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput, NotIdentifiable
from shm.identify import Dropped, IdentifyOptions, identify
from shm.identify.measuring.setups import measure_recordings, measure_set_ups
from shm.values import Channel, Recording
from tests.identify.signals import BIAXIAL, Sensor, half_sine, hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
RECORD = recording(hanger_modes(), noise=0.01)
SLOT = 8 * 1024


def _with(record: Recording, name: str, **spans: float) -> Recording:
    """Return the record with samples `first` to `last` of a channel set to `value`."""
    first, last, value = (int(spans["first"]), int(spans["last"]), spans["value"])
    channels = []
    for channel in record.channels:
        values = channel.values.copy()
        if channel.name == name:
            values[first:last] = value
        channels.append(replace(channel, values=values))
    return replace(record, channels=tuple(channels))


def _channels(record: Recording, *channels: Channel) -> Recording:
    return replace(record, channels=channels)


def test_each_hit_gives_a_ring_down_of_all_channels() -> None:
    measurement = measure_recordings([RECORD], OPTIONS)[0]
    assert [hit.used for hit in measurement.hits] == 5 * [True]
    assert {decay.shape[0] for decay in measurement.decays} == {2}
    assert len(measurement.decays) == 5
    assert measurement.sampling_rate_hz == 128.0
    assert [point.name for point in measurement.points] == ["acc_1", "acc_2"]


def test_hits_know_their_record_and_second() -> None:
    measurement = measure_recordings([RECORD, RECORD], OPTIONS)[0]
    assert [hit.record for hit in measurement.hits] == 5 * [0] + 5 * [1]
    assert measurement.hits[6].start_s == pytest.approx(8.3, abs=0.01)


def test_no_ring_down_holds_its_hit() -> None:
    """The free motion of a mode at 13.5 Hz has no step or bump where the pulse was."""
    measurement = measure_recordings([recording(hanger_modes()[1:2])], OPTIONS)[0]
    for decay in measurement.decays:
        begin, later = np.abs(decay[0, :20]).max(), np.abs(decay[0, 20:60]).max()
        assert begin == pytest.approx(later, rel=0.2)


def test_a_not_a_number_sample_of_the_force_drops_its_hit_alone() -> None:
    record = _with(RECORD, "force", first=SLOT + 4000, last=SLOT + 4001, value=np.nan)
    measurement = measure_recordings([record], OPTIONS)[0]
    assert [hit.used for hit in measurement.hits] == [True, False, True, True, True]
    assert measurement.hits[1].reason == "not-a-number samples"
    assert measurement.dropped == (Dropped("hits", 1, "not-a-number samples"),)
    assert all(np.isfinite(decay).all() for decay in measurement.decays)


@pytest.mark.parametrize("late", [4000, 500])
def test_a_gap_of_one_channel_ends_the_ring_down_or_drops_its_hit(late: int) -> None:
    record = _with(RECORD, "acc_2", first=SLOT + late, last=SLOT + late + 1, value=np.nan)
    measurement = measure_recordings([record], OPTIONS)[0]
    whole = late == 4000
    assert [hit.used for hit in measurement.hits] == [True, whole, True, True, True]
    told = measurement.hits[1].cut if whole else measurement.hits[1].reason
    assert told == "not-a-number samples"
    assert all(np.isfinite(decay).all() for decay in measurement.decays)


def test_a_channel_that_is_mostly_not_a_number_is_dropped_instead_of_the_hits() -> None:
    record = _with(RECORD, "acc_1", first=0, last=4 * SLOT, value=np.nan)
    measurement = measure_recordings([record], OPTIONS)[0]
    assert [point.name for point in measurement.points] == ["acc_2"]
    assert sum(hit.used for hit in measurement.hits) == 5
    assert measurement.dropped[0].what == "channel acc_1"


def test_a_dead_channel_is_dropped() -> None:
    record = _with(RECORD, "acc_2", first=0, last=5 * SLOT, value=0.07)
    (dropped,) = measure_recordings([record], OPTIONS)[0].dropped
    assert (dropped.what, "never changes" in dropped.reason) == ("channel acc_2", True)


def test_a_channel_without_plane_among_others_with_is_dropped() -> None:
    record = recording(hanger_modes(), (BIAXIAL[0], Sensor(None, 2.0)))
    (dropped,) = measure_recordings([record], OPTIONS)[0].dropped
    assert (dropped.what, "plane" in dropped.reason) == ("channel acc_2", True)


def test_a_ring_down_cut_off_is_dropped() -> None:
    channels = [replace(c, values=c.values[: 4 * SLOT + 1000]) for c in RECORD.channels]
    measurement = measure_recordings([_channels(RECORD, *channels)], OPTIONS)[0]
    assert [hit.reason for hit in measurement.hits][-1] == "ring-down cut off"


def test_a_constant_offset_changes_nothing() -> None:
    shifted = [replace(c, values=c.values + 9.81) for c in RECORD.accelerations]
    one = identify([RECORD], OPTIONS, test_id="a").test.modes
    other = identify([_channels(RECORD, RECORD.channels[0], *shifted)], OPTIONS, test_id="b")
    for mode, same in zip(one, other.test.modes, strict=True):
        assert mode.frequency_hz == pytest.approx(same.frequency_hz, rel=1e-6)


def test_no_usable_hit_is_not_identifiable_and_says_why() -> None:
    record = _with(RECORD, "acc_1", first=0, last=5 * SLOT, value=np.nan)
    record = _with(record, "acc_2", first=0, last=5 * SLOT, value=np.nan)
    with pytest.raises(NotIdentifiable, match="not-a-number"):
        measure_recordings([record], OPTIONS)[0]
    silent = _with(RECORD, "force", first=0, last=5 * SLOT, value=0.0)
    with pytest.raises(NotIdentifiable, match="no hammer hit") as caught:
        measure_recordings([silent], OPTIONS)[0]
    assert (caught.value.file, caught.value.channel) == ("test.csv", "force")
    assert caught.value.remedy


def test_a_record_of_two_samples_is_not_identifiable() -> None:
    channels = [replace(channel, values=channel.values[:2]) for channel in RECORD.channels]
    with pytest.raises(NotIdentifiable):
        identify([_channels(RECORD, *channels)], OPTIONS, test_id="t")


def test_a_record_without_force_among_others_or_without_acceleration_is_refused() -> None:
    with pytest.raises(BadInput, match="no force channel") as caught:
        measure_set_ups([RECORD, _channels(RECORD, *RECORD.accelerations)], OPTIONS)
    assert "N for the hammer" in caught.value.remedy
    with pytest.raises(BadInput, match="no acceleration channel"):
        measure_set_ups([_channels(RECORD, RECORD.channels[0])], OPTIONS)


def test_a_record_too_slow_for_the_band_is_refused() -> None:
    with pytest.raises(BadInput, match="too slow"):
        measure_set_ups([RECORD], IdentifyOptions(2.0, 600.0))


def test_records_of_different_sampling_rates_are_refused() -> None:
    with pytest.raises(BadInput, match="sampling rate differs"):
        measure_set_ups([RECORD, recording(hanger_modes(), rate_hz=2048.0)], OPTIONS)


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
