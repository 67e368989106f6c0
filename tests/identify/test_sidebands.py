"""Lines that a modulation makes beside a mode are none, and modes in like places stay.

exp(-s t) cos(w t) (1 + m cos(v t)) = exp(-s t) (cos w t + m/2 cos (w - v) t + m/2 cos (w + v) t).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify.contract import FoundMode
from shm.identify.estimation.postprocess import without_sidebands
from tests.identify.planted import none_found

RATE = 0.8  # of decay, in rad/s
ALONG, ACROSS = np.array([1.0, 0.6, 0.02]), np.array([0.1, -0.5, 1.0])


def _mode(frequency_hz: float, share: float = 1.0, rate: float = RATE) -> FoundMode:
    damping = rate / (2 * np.pi * frequency_hz)
    sd = np.full(3, 0.001)
    return FoundMode(frequency_hz, 1e-4, damping, 0.02 * damping, ALONG, sd, share)


def _kept(*modes: FoundMode) -> list[float]:
    found = without_sidebands(none_found(*modes))
    assert len(found.modes) + len(found.dropped) == len(modes)
    return [mode.frequency_hz for mode in found.modes]


def test_two_equal_lines_about_a_mode_are_its_sidebands() -> None:
    lines = _mode(28.5, 0.1), _mode(30.0), _mode(31.5, 0.1)
    assert _kept(*lines) == [30.0]
    (first, _) = without_sidebands(none_found(*lines)).dropped
    assert "sideband of the mode at 30 Hz" in first.reason


@pytest.mark.parametrize(
    "neighbour",
    [
        _mode(31.5, 0.1, rate=2 * RATE),
        _mode(31.5, 0.3),
        _mode(31.5, 1.2),
        _mode(31.7, 0.1),
        replace(_mode(31.5, 0.1), shape=ACROSS),
    ],
    ids=["decays faster", "unlike in size", "as strong", "not as far", "another shape"],
)
def test_modes_that_lie_about_a_third_stay(neighbour: FoundMode) -> None:
    assert len(_kept(_mode(28.5, 0.1), _mode(30.0), neighbour)) == 3
