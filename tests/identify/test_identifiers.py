"""The contract of our identifier: it finds what was planted, and refuses noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.errors import UsageError
from shm.identify import IDENTIFIERS, IdentifyOptions
from shm.identify.contract import FREQUENCY_FLOOR, Finding, Measurement
from shm.identify.identification import identifier
from shm.identify.measuring.setups import measure_recordings
from shm.values import FloatArray, Recording
from tests.identify.signals import Planted, Sensor, hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
identify = IDENTIFIERS["ssi"]


def _measured(modes: list[Planted], **keywords: object) -> Measurement:
    return measure_recordings([recording(modes, **keywords)], OPTIONS)[0]  # type: ignore[arg-type]


@cache
def _of_three_hits() -> Measurement:
    return _measured(hanger_modes(), noise=0.02, hits=3)


@cache
def _found() -> Finding:
    """Return the finding of the identifier."""
    return identify(_of_three_hits(), OPTIONS)


def _sensing(record: Recording, values: Sequence[FloatArray]) -> Recording:
    """Return the record with other accelerations."""
    pairs = zip(record.accelerations, values, strict=True)
    channels = [replace(channel, values=each) for channel, each in pairs]
    return replace(record, channels=(record.channels[0], *channels))


def _first_hit_ringing(measurement: Measurement, frequency_hz: float) -> Measurement:
    """Return the measurement with a ringing of the sensors after its first hit."""
    assert measurement.spectra is not None
    assert measurement.frequency_response is not None
    pole = -0.5 + 2j * np.pi * frequency_hz
    decay, driven = measurement.decays[0], measurement.driven[0].copy()
    time = np.arange(decay.shape[1]) / measurement.sampling_rate_hz
    ringing = 5 * np.exp(pole * time).imag
    driven[1:, driven.shape[1] - len(ringing) :] += ringing
    spectra = measurement.spectra.copy()
    lines = 2j * np.pi * measurement.frequency_response.frequency_hz
    spectra[0, 1:] += 5 * np.median(np.abs(spectra[0, 1:])) / (lines - pole)
    return replace(
        measurement,
        decays=(decay + ringing, *measurement.decays[1:]),
        driven=(driven, *measurement.driven[1:]),
        spectra=spectra,
    )


def _frequencies(finding: Finding) -> list[float]:
    return [mode.frequency_hz for mode in finding.modes]


def test_close_modes_of_two_planes_are_found_with_their_damping() -> None:
    planted = sorted(hanger_modes(skew_deg=10.0), key=lambda mode: mode.frequency_hz)
    finding = identify(_measured(planted, noise=0.02), OPTIONS)
    for found, truth in zip(finding.modes, planted, strict=True):
        assert found.frequency_hz == pytest.approx(truth.frequency_hz, rel=5e-4)
        assert found.damping_ratio == pytest.approx(truth.damping_ratio, rel=0.1)
        shape = np.array(truth.shape) / max(truth.shape, key=abs)
        np.testing.assert_allclose(found.shape, shape, atol=0.05)


def test_without_noise_frequencies_are_exact() -> None:
    """Free decays are sums of exponentials: nothing is approximated but by rounding."""
    planted = [Planted(7.0, 0.003, (1.0, 0.2)), Planted(19.0, 0.002, (-0.4, 1.0))]
    finding = identify(_measured(planted), OPTIONS)
    assert _frequencies(finding) == pytest.approx([7.0, 19.0], rel=1e-7)
    assert [m.damping_ratio for m in finding.modes] == pytest.approx([0.003, 0.002], rel=1e-4)


def test_noise_holds_no_mode() -> None:
    for hits in (5, 2):
        rng = np.random.default_rng(hits)
        record = recording(hanger_modes(), hits=hits, seconds=5.0, rate_hz=512.0)
        noise = [rng.standard_normal(len(c.values)) for c in record.accelerations]
        measurement = measure_recordings([_sensing(record, noise)], OPTIONS)[0]
        assert _frequencies(identify(measurement, OPTIONS)) == []


def test_silence_holds_no_mode() -> None:
    measurement = _measured(hanger_modes())
    assert measurement.spectra is not None
    spectra = measurement.spectra.copy()
    spectra[:, 1:] = 0
    still = np.array([[1.0], [0.0], [0.0]])
    silent = replace(
        measurement,
        decays=tuple(np.zeros_like(decay) for decay in measurement.decays),
        driven=tuple(still * driven for driven in measurement.driven),
        spectra=spectra,
    )
    finding = identify(silent, OPTIONS)
    assert finding.modes == ()
    assert len(finding.poles.order) == 0


def test_two_channels_that_say_the_same_do_no_harm() -> None:
    planted = [Planted(f, 0.003, (1.0, 1.0)) for f in (6.0, 13.5, 23.0)]
    for noise in (0.0, 0.02):
        record = recording(planted, (Sensor(), Sensor()), noise=noise, hits=3, seconds=5.0)
        same = _sensing(record, [record.accelerations[0].values] * 2)
        finding = identify(measure_recordings([same], OPTIONS)[0], OPTIONS)
        assert _frequencies(finding) == pytest.approx([6.0, 13.5, 23.0], rel=5e-4)


def test_modes_out_of_the_band_are_left_out() -> None:
    narrow = IdentifyOptions(10.0, 30.0)
    record = recording(hanger_modes(), noise=0.01)
    found = _frequencies(identify(measure_recordings([record], narrow)[0], narrow))
    assert len(found) == 4
    assert all(10 < frequency < 30 for frequency in found)


def test_standard_deviations_follow_the_noise() -> None:
    quiet, loud = (
        identify(_measured(hanger_modes(), noise=noise, seed=3), OPTIONS).modes
        for noise in (0.01, 0.1)
    )
    ratio = [b.frequency_sd_hz / a.frequency_sd_hz for a, b in zip(quiet, loud, strict=True)]
    assert np.median(ratio) == pytest.approx(10.0, rel=0.5)
    for mode in quiet:
        assert 0 < mode.damping_sd < 0.2 * mode.damping_ratio
        assert np.all(mode.shape_sd >= 0)


@pytest.mark.parametrize("hits", [1, 2])
def test_below_three_hits_only_the_stated_floor_is_claimed(hits: int) -> None:
    for mode in identify(_measured(hanger_modes(), noise=0.01, hits=hits), OPTIONS).modes:
        assert mode.frequency_sd_hz == pytest.approx(FREQUENCY_FLOOR * mode.frequency_hz)
        assert np.isnan(mode.damping_sd)
        assert np.isnan(mode.shape_sd).all()


def test_one_disturbed_hit_does_not_make_a_mode() -> None:
    """A ringing at 41 Hz after one hit of five is not the hanger's."""
    finding = identify(_first_hit_ringing(_measured(hanger_modes(), noise=0.01), 41.0), OPTIONS)
    assert len(finding.modes) == 8
    near = np.abs(finding.poles.frequency_hz - 41.0) < 0.1
    assert near.any()
    assert not finding.poles.stable[near].any()


def test_every_pole_is_in_a_mode_or_counted_with_its_reason() -> None:
    """Of order n a state-space model has n poles, of which a pair counts once."""
    orders = range(2, 41, 2)
    stated = replace(OPTIONS, max_order=max(orders))
    # A mode at the sensors alone after the first hit is stable over the orders, and dropped.
    measurement = _first_hit_ringing(_measured(hanger_modes(), noise=0.05), 41.0)
    finding = identify(measurement, stated)
    counts = {entry.reason: entry.count for entry in finding.dropped if entry.what == "poles"}
    assert len(counts) == len([entry for entry in finding.dropped if entry.what == "poles"])
    counted = int(finding.poles.stable.sum()) + sum(counts.values())
    assert 2 * counted == sum(orders) + counts["do not oscillate"]


def test_what_differs_between_tests_is_added_to_each_frequency() -> None:
    alone = _found().modes
    allowed = identify(_of_three_hits(), replace(OPTIONS, frequency_allowance=0.0003)).modes
    for one, other in zip(alone, allowed, strict=True):
        expected = np.hypot(one.frequency_sd_hz, 0.0003 * one.frequency_hz)
        assert other.frequency_sd_hz == pytest.approx(expected, rel=1e-9)


def test_a_single_sensor_axis_is_enough_for_modes_apart() -> None:
    planted = [Planted(f, 0.003, (1.0,)) for f in (6.0, 13.5, 23.0)]
    finding = identify(_measured(planted, sensors=(Sensor(),), noise=0.02, hits=3), OPTIONS)
    assert _frequencies(finding) == pytest.approx([6.0, 13.5, 23.0], rel=5e-4)


def test_many_channels_are_no_harder_than_few() -> None:
    places = np.linspace(0.5, 4.0, 12)
    planted = [
        Planted(f, 0.003, tuple(np.sin(n * np.pi * places / 9)))
        for n, f in enumerate((5.0, 10.6, 17.0, 24.5, 33.0), 1)
    ]
    sensors = tuple(Sensor("transverse", float(x)) for x in places)
    finding = identify(_measured(planted, sensors=sensors, noise=0.02, hits=3), OPTIONS)
    assert _frequencies(finding) == pytest.approx([5.0, 10.6, 17.0, 24.5, 33.0], rel=5e-4)


def test_the_diagram_marks_the_poles_of_the_modes_as_stable() -> None:
    finding = _found()
    poles = finding.poles
    assert len(poles.order) == len(poles.frequency_hz) == len(poles.damping_ratio)
    for frequency in _frequencies(finding):
        near = np.abs(poles.frequency_hz / frequency - 1) < 1e-3
        assert poles.stable[near].sum() > 5


def test_the_same_measurement_gives_the_same_modes() -> None:
    again = identify(_measured(hanger_modes(), noise=0.02, hits=3), OPTIONS)
    assert _frequencies(again) == _frequencies(_found())


def test_the_size_of_the_model_may_be_stated() -> None:
    measurement = _measured(hanger_modes(), noise=0.02)
    stated = replace(OPTIONS, block_rows=60, max_order=40)
    finding = identify(measurement, stated)
    assert len(finding.modes) == 8
    assert finding.poles.order.max() <= 40


def test_an_unknown_identifier_is_a_usage_error_that_names_the_known() -> None:
    with pytest.raises(UsageError, match="ssi"):
        identifier("peak picking")


@pytest.mark.parametrize(
    "wrong",
    [
        {"band_low_hz": 50.0, "band_high_hz": 10.0},
        {"band_low_hz": -1.0},
        {"max_order": 0},
        {"block_rows": 1},
    ],
)
def test_options_that_cannot_be_are_usage_errors(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        IdentifyOptions(**wrong)  # type: ignore[arg-type]
