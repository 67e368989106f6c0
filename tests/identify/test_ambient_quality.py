"""What is wrong with a record that nobody hit: trucks, noise, wide modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.contract import FoundMode
from shm.identify.measuring.ambient import ambient_measurement
from shm.identify.quality import Inspection
from shm.identify.quality.of_ambient import ROWS
from shm.values import Hanger, QualityCheck, Recording
from tests.identify.planted import none_found
from tests.identify.signals import Planted
from tests.identify.test_ambient import OPTIONS, RECORD, record_of

_, _HEIGHT = ROWS

DECK = Hanger.without_model(100, "Deck")
WIDE = (Planted(5.0, 0.02, (1.0, 0.3, 0.6)), Planted(11.0, 0.02, (0.5, 0.2, -1.0)))


def _with_truck(record: Recording) -> Recording:
    swell = np.ones(record.samples)
    swell[20_000:21_500] = 30.0
    channels = tuple(replace(c, values=c.values * swell) for c in record.channels)
    return replace(record, channels=channels)


def _named(result: Identification, name: str) -> QualityCheck:
    return next(check for check in result.quality if check.name == name)


def test_steady_wind_is_good_and_says_so_by_figures() -> None:
    result = identify([RECORD], OPTIONS, test_id="t")
    for name in ("stationarity", "peak height"):
        assert _named(result, name).verdict == "good"
    assert 1.0 <= _named(result, "stationarity").value < 2.0
    assert _named(result, "peak height").value > 20


def test_a_truck_is_set_apart_and_told() -> None:
    measurement = ambient_measurement([_with_truck(RECORD)], OPTIONS)
    (entry,) = measurement.dropped
    assert "truck" in entry.reason
    assert len(measurement.decays) + entry.count == len(
        ambient_measurement([RECORD], OPTIONS).decays
    )
    result = identify([_with_truck(RECORD)], OPTIONS, test_id="t")
    assert _named(result, "stationarity").verdict == "warning"
    assert len(result.test.modes) == 4


def test_mains_that_wander_are_a_tone() -> None:
    """By a hertz in 3000 over a quarter of an hour: no mode keeps its phase as long."""
    time = np.arange(RECORD.samples) / RECORD.sampling_rate_hz
    hum = 0.3 * np.sin(2 * np.pi * 25.0 * time + 1.2 * np.sin(2 * np.pi * time / time[-1]))
    channels = tuple(replace(c, values=c.values + hum * np.std(c.values)) for c in RECORD.channels)
    options = replace(OPTIONS, mains_hz=25.0)
    result = identify([replace(RECORD, channels=channels)], options, test_id="t")
    assert _named(result, "tones").verdict == "warning"


def test_wide_modes_are_kept_with_their_deviations() -> None:
    """Of 2 % damping and six minutes: sqrt(z / (w T)) is 0.0013 at 5 Hz, and SSI has more."""
    options = IdentifyOptions(2.0, 40.0)
    result = identify([record_of(WIDE, 400.0, seed=3)], options, test_id="t", hanger=DECK)
    modes = {round(mode.frequency_hz): mode for mode in result.test.modes}
    for planted in WIDE:
        mode = modes[round(planted.frequency_hz)]
        assert abs(mode.frequency_hz - planted.frequency_hz) < 4 * mode.frequency_sd_hz
    assert modes[5].frequency_sd_hz / modes[5].frequency_hz > 0.001


def _inspection(known_hz: tuple[float, ...]) -> Inspection:
    modes = (FoundMode(f, 0.01, 0.003, 1e-4, np.ones(3), np.empty(0)) for f in known_hz)
    finding = none_found(*modes)
    return Inspection([RECORD], [ambient_measurement([RECORD], OPTIONS)], OPTIONS, (), finding)


def test_modes_where_the_spectrum_has_no_peak_are_warned_of() -> None:
    check = _HEIGHT.check(_inspection((17.0, 30.0)))
    assert check is not None
    assert check.verdict == "warning"
