"""A round bar is hit along both axes in turn: equal frequencies, two set-ups, two directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import Hanger, Plane, Recording

AREA = np.pi * 0.13**2 / 4
HANGER = Hanger(3, 12.0, 200e9, AREA, np.pi * 0.13**4 / 64, 7800 * AREA, 711e3)
PLAN = HammerPlan(hits=4, seconds_per_hit=8.0, sampling_rate_hz=256.0, peak_force_n=1000.0)


def hit(plane: Plane, angle_deg: float) -> Recording:
    plan = replace(PLAN, hammer_angle_deg=angle_deg)
    made = hammer_test(HANGER, HangerState(711e3), plan, np.random.default_rng(5))
    force, *others = made.channels
    return replace(made, channels=(replace(force, plane=plane), *others))


def test_modes_of_equal_frequency_keep_their_directions() -> None:
    records = [hit("transverse", 0.0), hit("longitudinal", 90.0)]
    found = identify(records, IdentifyOptions(2.0, 100.0), test_id="t1", hanger=HANGER).test
    for plane in ("transverse", "longitudinal"):
        modes = [mode for mode in found.modes if mode.plane == plane]
        assert [mode.order for mode in modes] == [1, 2, 3, 4, 5, 6]
        assert max(abs(point.cross) for mode in modes for point in mode.shape) < 0.01
        assert all(mode.acceleration_m_s2 > 0 for mode in modes)


def test_an_allowance_for_shapes_is_added_to_their_deviations() -> None:
    records = [hit("transverse", 0.0)]
    plain, allowed = (
        identify(records, replace(IdentifyOptions(2.0, 50.0), shape_allowance=share), test_id="t1")
        for share in (0.0, 0.02)
    )
    for one, other in zip(plain.test.modes, allowed.test.modes, strict=True):
        for a, b in zip(one.shape, other.shape, strict=True):
            assert b.sd == pytest.approx(np.hypot(a.sd, 0.02), rel=1e-6)
