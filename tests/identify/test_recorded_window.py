"""An analyser's exponential window on time records is recognised by the sensors' noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.values import Recording
from tests.identify.signals import hanger_modes, recording

RATE_HZ, SLOT_S, CONSTANT_S = 512.0, 8.0, 2.5


def _windowed(made: Recording, quantities: tuple[str, ...]) -> Recording:
    since_s = np.maximum(np.arange(made.samples) / RATE_HZ - 0.3, 0.0) % SLOT_S
    window = np.exp(-since_s / CONSTANT_S)
    channels = (
        replace(c, values=c.values * window) if c.quantity in quantities else c
        for c in made.channels
    )
    return replace(made, channels=tuple(channels))


@pytest.mark.parametrize("quantities", [("force", "acceleration"), ("acceleration",)])
def test_a_window_is_named_and_widens_the_damping(quantities: tuple[str, ...]) -> None:
    """That a record without one has no such check is asked of sound records."""
    made = recording(hanger_modes(), hits=4, seconds=SLOT_S, rate_hz=RATE_HZ, noise=1e-3)
    found = identify([_windowed(made, quantities)], IdentifyOptions(2.0, 50.0), test_id="t")
    (check,) = [check for check in found.quality if check.name == "window"]
    assert check.verdict == "warning"
    assert check.value == pytest.approx(1 / CONSTANT_S, rel=0.05)
    true = {round(mode.frequency_hz, 1): mode.damping_ratio for mode in hanger_modes()}
    assert found.test.modes
    for mode in found.test.modes:
        nearest = min(true, key=lambda hz: abs(hz - mode.frequency_hz))
        assert abs(mode.damping_ratio - true[nearest]) < 1.645 * mode.damping_sd
        of_window = check.value / (2 * np.pi * mode.frequency_hz)
        assert of_window * (1 - 1e-9) <= mode.damping_sd < 1.2 * of_window
        assert mode.damping_ratio > 1.2 * true[nearest]
