"""Where no channel states its plane, that is blamed before the test itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import IdentifyOptions, identify
from shm.simulate import HammerPlan, HangerState
from shm.values import Recording
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.hammer import hammer_test


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Return the planes differ by their end springs, and no channel states which is whose."""
    state = HangerState(450e3, 5e6, 2e7, 5e6, 8e6)
    plan = HammerPlan(hits=3, seconds_per_hit=8.0, sensors_x_m=(2.52,))
    found = hammer_test(HANGER_3, state, plan, np.random.default_rng(1))
    return replace(found, channels=tuple(replace(c, plane=None) for c in found.channels))


def test_identify_refusal_names_missing_planes(recording: Recording) -> None:
    found = identify([recording], IdentifyOptions(band_high_hz=45.0), test_id="t", hanger=HANGER_3)
    with pytest.raises(NotIdentifiable, match="no channel states its plane") as refused:
        found.with_orders("t.csv")
    assert "`shm import FILE`" in refused.value.remedy
    assert "softer tip" not in refused.value.remedy


def test_identify_warning_names_missing_planes(recording: Recording) -> None:
    found = identify([recording], test_id="t", hanger=HANGER_3)
    assert found.test.modes
    warnings = {each.name: each for each in found.quality if each.verdict == "warning"}
    assert warnings.keys() == {"numbering"}
    assert "no channel states its plane" in warnings["numbering"].found
    assert "`shm import FILE`" in warnings["numbering"].remedy
