from __future__ import annotations

import numpy as np
import pytest

from shm.identify.measuring.band import RATE_OVER_BAND, band_limited, least_seconds


@pytest.mark.parametrize("rate_hz", [512.0, 2048.0, 25_600.0])
def test_an_exponential_in_the_band_stays_the_same_exponential(rate_hz: float) -> None:
    """A finite filter maps exp(s t) to H(s) exp(s t): samples keep their ratio exp(s dt)."""
    pole = -2.0 + 2j * np.pi * 60.0
    signal = np.exp(pole * np.arange(int(3 * rate_hz)) / rate_hz)
    limited, rate = band_limited(np.vstack([signal.real, signal.imag]), rate_hz, 100.0)
    decay = limited[0] + 1j * limited[1]
    np.testing.assert_allclose(decay[1:] / decay[:-1], np.exp(pole / rate), rtol=1e-9)


def test_its_amplitude_stays_within_a_hundredth_across_the_band() -> None:
    time = np.arange(8192) / 2048
    for frequency in (3.0, 50.0, 99.0):
        limited, _ = band_limited(np.sin(2 * np.pi * frequency * time)[np.newaxis], 2048.0, 100.0)
        assert np.sqrt(2) * limited.std() == pytest.approx(1.0, abs=0.01)


def test_what_would_fold_into_the_band_is_taken_out() -> None:
    time = np.arange(16_384) / 2048
    for frequency in (160.0, 250.0, 400.0, 1000.0):
        limited, rate = band_limited(
            np.sin(2 * np.pi * frequency * time)[np.newaxis], 2048.0, 100.0
        )
        folded = abs(frequency - rate * round(frequency / rate))
        if folded <= 100.0:
            assert np.abs(limited).max() < 1e-4


def test_the_new_rate_holds_the_band() -> None:
    for rate_hz in (300.0, 1000.0, 4096.0):
        _, rate = band_limited(np.zeros((1, 4000)), rate_hz, 100.0)
        assert rate >= RATE_OVER_BAND * 100.0


def test_a_slow_record_is_left_as_it_is() -> None:
    signal = np.random.default_rng(0).standard_normal((2, 500))
    limited, rate = band_limited(signal, 400.0, 100.0)
    assert rate == 400.0
    np.testing.assert_array_equal(limited, signal)


def test_the_least_length_leaves_samples_to_identify_from() -> None:
    for rate_hz in (512.0, 2000.0, 10_000.0):
        samples = int(np.ceil(least_seconds(100.0) * rate_hz))
        limited, _ = band_limited(np.ones((1, samples)), rate_hz, 100.0)
        assert limited.shape[1] >= 60
