"""Hits are found without a force channel, and motion that nobody struck has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.identify.measuring.unforced_hits import find_unforced
from tests.identify.signals import hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
FORCED = recording(hanger_modes(), noise=0.01)
TAPS = replace(FORCED, channels=FORCED.accelerations)
RATE_HZ = 256.0


def _ambient(seed: int) -> np.ndarray:
    """Two modes that beat and one beside them, moved by noise; a swell of a second doubles it."""
    rng = np.random.default_rng(seed)
    samples = int(60 * RATE_HZ)
    t = np.arange(samples) / RATE_HZ
    motion = 0.02 * rng.standard_normal((2, samples))
    for frequency_hz, place in ((9.0, 0), (10.5, 0), (24.0, 1)):
        pole = 2 * np.pi * frequency_hz * (1j - 0.003)
        impulse = np.exp(pole * t[: int(8 * RATE_HZ)]).imag
        modal = np.convolve(rng.standard_normal(samples), impulse)[:samples]
        motion[place] += modal / modal.std()
    swell = 1 + 3 * np.exp(-0.5 * ((t - 30) / 1.0) ** 2)
    return np.asarray(motion * swell)


def test_taps_are_found_where_the_force_says_that_the_hammer_struck() -> None:
    accelerations = np.array([c.values for c in TAPS.channels])
    pulses = find_unforced(accelerations, TAPS.sampling_rate_hz, OPTIONS.band_high_hz)
    known = identify([FORCED], OPTIONS, test_id="t").hits
    assert len(pulses) == len(known)
    for pulse, hit in zip(pulses, known, strict=True):
        assert pulse.start <= hit.start < pulse.end < hit.start + 0.1 * TAPS.sampling_rate_hz


@pytest.mark.parametrize("seed", range(5))
def test_wind_and_a_truck_are_no_hits(seed: int) -> None:
    assert find_unforced(_ambient(seed), RATE_HZ, 50.0) == []


def test_where_the_force_shows_no_hits_those_of_the_motion_are_used_with_a_warning() -> None:
    """A slow logger without a filter misses pulses between two samples: here all of them."""
    silent = replace(FORCED.channels[0], values=0.01 * np.sin(np.arange(FORCED.samples)))
    missed = replace(FORCED, channels=(silent, *FORCED.accelerations))
    found = identify([missed], OPTIONS, test_id="t")
    assert len(found.test.modes) == len(identify([TAPS], OPTIONS, test_id="t").test.modes)
    cable = next(check for check in found.quality if check.name == "cable")
    assert cable.verdict == "warning"
    assert silent.name in cable.found
