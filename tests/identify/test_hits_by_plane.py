"""A round bar is hit along both axes in turn: equal frequencies, two set-ups, two directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.simulate import HammerPlan, HangerState
from shm.values import Hanger, Plane, Recording
from tests.identify.signals import as_recording, force_signal, hanger_modes, response
from tests.worlds.simulated.hammer import hammer_test

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


def test_hits_of_both_planes_in_one_file_are_compared_by_plane() -> None:
    directions = "tlttl"
    slot, rate_hz = 8 * 512, 512.0
    rng = np.random.default_rng(1)
    force, motion = np.zeros(len(directions) * slot), np.zeros((2, len(directions) * slot))
    for row, plane in enumerate("tl"):
        starts = [150 + n * slot for n, each in enumerate(directions) if each == plane]
        pushes = force_signal(starts, len(force), rate_hz, rng.uniform(1500, 2500, len(starts)))
        modes = [
            replace(mode, drive=mode.drive * (1.0 if number // 4 == row else 0.05))
            for number, mode in enumerate(hanger_modes(3.0))
        ]
        force += pushes
        motion += response(modes, pushes, rate_hz)
    motion += 1e-2 * rng.standard_normal(motion.shape)
    force += 0.2 * rng.standard_normal(force.shape)
    found = identify(
        [as_recording(force, motion, rate_hz)], IdentifyOptions(2.0, 50.0), test_id="t"
    )
    assert len(found.test.modes) == 8
    assert all(hit.used for hit in found.hits)
    verdicts = {check.name: check.verdict for check in found.quality}
    assert verdicts["coherence"] == verdicts["repeatability"] == "good"
