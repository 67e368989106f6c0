from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import IDENTIFIERS, IdentifyOptions
from shm.identify.contract import Measurement
from shm.values import ResponsePoint
from tests.identify.signals import Planted, force_signal, response

OPTIONS = IdentifyOptions(2.0, 50.0)
RATE_HZ = 128.0
MODES = [Planted(6.0, 0.003, (1.0, 0.2)), Planted(17.0, 0.002, (-0.4, 1.0))]


def _struck_again(noise: float) -> Measurement:
    """Three hits, each with a second blow in what should be free decay; all of it is measured."""
    rng = np.random.default_rng(4)
    driven = []
    for _ in range(3):
        starts = [40, 300 + int(rng.integers(100)), 700]
        force = force_signal(starts, 2000, RATE_HZ, [900.0, 700.0, 500.0])
        motion = response(MODES, force, RATE_HZ)
        driven.append(np.vstack([force, motion + noise * rng.standard_normal(motion.shape)]))
    points = (ResponsePoint("a", "transverse", 1.0), ResponsePoint("b", "longitudinal", 1.0))
    decays = tuple(each[1:, 45:] for each in driven)
    return Measurement("test", points, decays, RATE_HZ, None, driven=tuple(driven))


def test_blows_that_are_measured_do_not_disturb() -> None:
    found = IDENTIFIERS["ssi-input"](_struck_again(noise=0.5), OPTIONS).modes
    assert [m.frequency_hz for m in found] == pytest.approx([6.0, 17.0], rel=2e-4)
    assert [m.damping_ratio for m in found] == pytest.approx([0.003, 0.002], rel=0.1)


def test_without_a_force_it_refuses() -> None:
    with pytest.raises(NotIdentifiable, match="force"):
        IDENTIFIERS["ssi-input"](replace(_struck_again(0.0), driven=()), OPTIONS)
