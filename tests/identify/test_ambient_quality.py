"""What is wrong with a record that nobody hit: trucks, noise, peaks without a mode, wide modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.contract import Dropped, Finding, FoundMode, Poles
from shm.identify.estimation.ssi import merge_findings
from shm.identify.measuring.ambient import LEAST_PARTS, LOUDER, ambient_measurement, set_apart
from shm.identify.quality import Inspection
from shm.identify.quality.of_ambient import ROWS
from shm.values import Hanger, QualityCheck, Recording
from tests.identify.signals import Planted, as_recording, response
from tests.identify.test_ambient import OPTIONS, RATE_HZ, RECORD, SENSORS

_, _HEIGHT, _PEAKS = ROWS

DECK = Hanger.without_model(100, "Deck")
WIDE = (Planted(5.0, 0.02, (1.0, 0.3, 0.6)), Planted(11.0, 0.02, (0.5, 0.2, -1.0)))


def _moved(modes: tuple[Planted, ...], seconds: float, noise: float = 0.02) -> Recording:
    rng = np.random.default_rng(3)
    samples = round(seconds * RATE_HZ)
    total = np.zeros((3, samples))
    for mode in modes:
        wind = rng.standard_normal(samples)
        total += response([mode], wind, RATE_HZ) - np.outer(mode.shape, wind)
    total += noise * np.std(total) * rng.standard_normal(total.shape)
    record = as_recording(np.zeros(samples), total, RATE_HZ, SENSORS)
    return replace(record, channels=record.channels[1:])


def _with_truck(record: Recording) -> Recording:
    swell = np.ones(record.samples)
    swell[20_000:21_500] = 30.0
    channels = tuple(replace(c, values=c.values * swell) for c in record.channels)
    return replace(record, channels=channels)


def _named(result: Identification, name: str) -> QualityCheck:
    return next(check for check in result.quality if check.name == name)


def test_steady_wind_is_good_and_says_so_by_figures() -> None:
    result = identify([RECORD], OPTIONS, test_id="t")
    for name in ("stationarity", "peak height", "missed peaks"):
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


def test_loud_parts_stay_where_too_few_would_be_left() -> None:
    rng = np.random.default_rng(0)
    quiet = [rng.standard_normal((2, 500)) for _ in range(LEAST_PARTS)]
    loud = [3 * LOUDER * rng.standard_normal((2, 500)) for _ in range(2)]
    assert set_apart([*quiet, *loud])[1] == 2
    assert set_apart([*quiet[1:], *loud])[1] == 0


def test_no_part_outweighs_the_rest() -> None:
    """Differences from sample to sample have the same mean square in all."""
    for part in ambient_measurement([_with_truck(RECORD)], OPTIONS).decays:
        assert np.mean(np.diff(part, axis=1) ** 2) == pytest.approx(1.0)


def test_wide_modes_are_kept_with_their_deviations() -> None:
    """Of 2 % damping and six minutes: sqrt(z / (w T)) is 0.0013 at 5 Hz, and SSI has more."""
    options = IdentifyOptions(2.0, 40.0)
    result = identify([_moved(WIDE, 400.0)], options, test_id="t", hanger=DECK)
    modes = {round(mode.frequency_hz): mode for mode in result.test.modes}
    for planted in WIDE:
        mode = modes[round(planted.frequency_hz)]
        assert abs(mode.frequency_hz - planted.frequency_hz) < 4 * mode.frequency_sd_hz
    assert modes[5].frequency_sd_hz / modes[5].frequency_hz > 0.001


def test_what_a_record_gives_at_best_follows_its_length() -> None:
    short, long = (replace(IdentifyOptions(), ambient_s=seconds) for seconds in (100.0, 400.0))
    assert short.at_best(5.0, 0.02)[0] == pytest.approx(np.sqrt(0.02 / (2 * np.pi * 500)))
    assert long.at_best(5.0, 0.02)[0] == pytest.approx(short.at_best(5.0, 0.02)[0] / 2)
    assert IdentifyOptions().at_best(5.0, 0.02) == (0.0, 0.0)


def _inspection(known_hz: tuple[float, ...]) -> Inspection:
    nothing = np.empty(0)
    modes = tuple(FoundMode(f, 0.01, 0.003, 1e-4, np.ones(3), nothing) for f in known_hz)
    finding = Finding(modes, (), Poles(nothing, nothing, nothing, nothing.astype(bool)))
    return Inspection([RECORD], [ambient_measurement([RECORD], OPTIONS)], OPTIONS, (), finding)


def test_a_strong_peak_without_a_mode_is_named() -> None:
    check = _PEAKS.check(_inspection((6.0, 6.3, 13.5)))
    assert check is not None
    assert check.verdict == "warning"
    assert "23 Hz" in check.found
    whole = _PEAKS.check(_inspection((6.0, 6.3, 13.5, 23.0)))
    assert whole is not None
    assert whole.verdict == "good"


def test_modes_where_the_spectrum_has_no_peak_are_warned_of() -> None:
    check = _HEIGHT.check(_inspection((17.0, 30.0)))
    assert check is not None
    assert check.verdict == "warning"


def test_after_hits_these_checks_do_not_arise() -> None:
    inspection = replace(_inspection((6.0,)), records=())
    assert [row.check(inspection) for row in ROWS] == [None, None, None]


def test_a_finding_is_completed_by_what_it_lacks() -> None:
    one = _inspection((6.0, 13.5)).finding
    other = _inspection((13.51, 23.0)).finding
    assert one is not None
    assert other is not None
    lost = Dropped("mode at 23 Hz", 1, "its frequency changes from hit to hit", 23.01)
    whole = merge_findings(replace(one, dropped=(lost,)), other)
    assert [mode.frequency_hz for mode in whole.modes] == [6.0, 13.5, 23.0]
    assert whole.dropped == ()
