"""A mode that moves in both planes stands for one of each; a resolved pair is left as it is."""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.placement import blur, with_both_planes
from shm.values import ResponsePoint

BIAXIAL = (ResponsePoint("acc_1", "transverse", 2.0), ResponsePoint("acc_2", "longitudinal", 2.0))


def mode(frequency_hz: float, transverse: float, longitudinal: float) -> FoundMode:
    shape = np.array([transverse, longitudinal])
    return FoundMode(frequency_hz, 0.001, 0.002, 0.0001, shape, np.full(2, 0.01))


def test_an_unresolved_pair_stands_in_both_planes_with_a_tenth_of_its_bandwidth() -> None:
    found, planes = with_both_planes([mode(10.0, 1.0, 0.9)], ["transverse"], BIAXIAL)
    assert planes == ["transverse", "longitudinal"]
    assert found[0] is found[1]
    assert blur(found[0]).frequency_sd_hz == pytest.approx(np.hypot(0.001, 0.004))


def test_a_mode_in_one_plane_is_left_alone() -> None:
    modes = [mode(10.0, 1.0, 0.1)]
    assert with_both_planes(modes, ["transverse"], BIAXIAL) == (modes, ["transverse"])


def test_a_resolved_pair_in_skewed_directions_is_left_alone() -> None:
    modes = [mode(10.0, 1.0, 0.6), mode(10.05, -0.6, 1.0)]
    planes = ["transverse", "longitudinal"]
    assert with_both_planes(modes, planes, BIAXIAL) == (modes, planes)


def test_nothing_is_split_where_only_one_plane_is_measured() -> None:
    modes = [mode(10.0, 1.0, 0.9)]
    single = (ResponsePoint("acc_1", "transverse"), ResponsePoint("acc_2", None))
    assert with_both_planes(modes, ["transverse"], single) == (modes, ["transverse"])


def test_an_unknown_standard_deviation_becomes_a_tenth_of_the_bandwidth() -> None:
    shape = np.array([1.0, 1.0])
    unknown = FoundMode(10.0, np.nan, 0.002, np.nan, shape, np.full(2, np.nan))
    assert blur(unknown).frequency_sd_hz == pytest.approx(0.004)


@pytest.mark.parametrize("share", [0.12, 0.17, 0.83, 0.88])
def test_both_planes_are_judged_alike(share: float) -> None:
    """15 % of the energy in the weaker plane, whichever that is."""
    transverse, longitudinal = float(np.sqrt(share)), float(np.sqrt(1 - share))
    _, planes = with_both_planes([mode(10.0, transverse, longitudinal)], ["transverse"], BIAXIAL)
    assert (len(planes) == 2) == (0.15 < share < 0.85)
