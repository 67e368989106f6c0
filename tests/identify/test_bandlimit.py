from __future__ import annotations

import numpy as np
import pytest

from shm.identify.measuring.band import band_limited


@pytest.mark.parametrize(
    ("rate_hz", "off"),
    [(512.0, 1e-9), (2048.0, 1e-9), (25_600.0, 1e-9), (300.0, 1e-5), (500.0, 1e-5), (1652.0, 1e-5)],
)
def test_an_exponential_in_the_band_stays_the_same_exponential(rate_hz: float, off: float) -> None:
    """A finite filter maps exp(s t) to H(s) exp(s t): samples keep their ratio exp(s dt).

    Between samples of the signal its images are 90 dB down. No rate stays an eighth above the one
    that the band asks: lags in samples are as long for every logger.
    """
    pole = -2.0 + 2j * np.pi * 60.0
    signal = np.exp(pole * np.arange(int(3 * rate_hz)) / rate_hz)
    limited, rate = band_limited(np.vstack([signal.real, signal.imag]), rate_hz, 100.0)
    decay = limited[0] + 1j * limited[1]
    np.testing.assert_allclose(decay[1:] / decay[:-1], np.exp(pole / rate), rtol=off)
    assert 256 <= rate < 256 * 9 / 8


def test_what_would_fold_into_the_band_is_taken_out() -> None:
    time = np.arange(16_384) / 2048
    for frequency in (160.0, 250.0, 400.0, 1000.0):
        limited, rate = band_limited(
            np.sin(2 * np.pi * frequency * time)[np.newaxis], 2048.0, 100.0
        )
        folded = abs(frequency - rate * round(frequency / rate))
        if folded <= 100.0:
            assert np.abs(limited).max() < 1e-4
