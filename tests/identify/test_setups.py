"""Records of one test are sorted into set-ups, and each is measured on the same lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import IdentifyOptions
from shm.identify.measuring.setups import measure_set_ups
from shm.values import Plane, Recording
from tests.identify.signals import Sensor, hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)


def _record(x_m: float = 2.0, hits: int = 2, seed: int = 0, seconds: float = 4.0) -> Recording:
    sensors = (Sensor("transverse", x_m), Sensor("longitudinal", x_m))
    return recording(hanger_modes(), sensors, hits=hits, seconds=seconds, noise=0.01, seed=seed)


def _hit_at(record: Recording, x_m: float, plane: Plane | None = None) -> Recording:
    force = replace(record.channels[0], x_m=x_m, plane=plane)
    return replace(record, channels=(force, *record.channels[1:]))


def test_records_of_the_same_sensors_and_hammer_are_one_set_up() -> None:
    (measurement,) = measure_set_ups([_record(seed=1), _record(seed=2)], OPTIONS)
    assert [hit.record for hit in measurement.hits] == [0, 0, 1, 1]
    assert len(measurement.driven) == len(measurement.decays) == 4


def test_a_hammer_elsewhere_or_in_another_direction_is_another_set_up() -> None:
    record = _record()
    records = [
        _hit_at(record, 1.0, "transverse"),
        _hit_at(record, 1.5, "transverse"),
        _hit_at(record, 1.0, "longitudinal"),
        _hit_at(record, 1.0, "transverse"),
    ]
    measurements = measure_set_ups(records, OPTIONS)
    places = [(m.hammer.x_m, m.hammer.plane) for m in measurements if m.hammer]
    assert places == [(1.0, "transverse"), (1.5, "transverse"), (1.0, "longitudinal")]
    assert [len(m.hits) for m in measurements] == [4, 2, 2]


def test_a_set_up_without_usable_hits_is_left_out_and_said_so() -> None:
    silent = _record(3.0)
    force = replace(silent.channels[0], values=np.zeros(silent.samples))
    silent = replace(silent, source="bad.csv", channels=(force, *silent.channels[1:]))
    (measurement,) = measure_set_ups([_record(), silent], OPTIONS)
    assert measurement.dropped[0].what == "set-up bad.csv"
    assert "no hammer hit" in measurement.dropped[0].reason
    with pytest.raises(NotIdentifiable, match="no hammer hit"):
        measure_set_ups([silent], OPTIONS)
