"""A mode that moves in both planes stands for one of each; a resolved pair is left as it is."""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.planes import blur, is_unresolved_pair
from shm.values import ResponsePoint

BIAXIAL = (ResponsePoint("acc_1", "transverse", 2.0), ResponsePoint("acc_2", "longitudinal", 2.0))


def mode(frequency_hz: float, transverse: float, longitudinal: float) -> FoundMode:
    shape = np.array([transverse, longitudinal])
    return FoundMode(frequency_hz, 0.001, 0.002, 0.0001, shape, np.full(2, 0.01))


def test_an_unresolved_pair_stands_in_both_planes_with_a_tenth_of_its_bandwidth() -> None:
    pair = mode(10.0, 1.0, 0.9)
    assert is_unresolved_pair(pair, [pair], BIAXIAL)
    assert blur(pair).frequency_sd_hz == pytest.approx(np.hypot(0.001, 0.004))


def test_a_mode_in_one_plane_is_left_alone() -> None:
    single = mode(10.0, 1.0, 0.1)
    assert not is_unresolved_pair(single, [single], BIAXIAL)


def test_a_resolved_pair_in_skewed_directions_is_left_alone() -> None:
    modes = [mode(10.0, 1.0, 0.6), mode(10.05, -0.6, 1.0)]
    assert not any(is_unresolved_pair(each, modes, BIAXIAL) for each in modes)


def test_nothing_is_split_where_only_one_plane_is_measured() -> None:
    pair = mode(10.0, 1.0, 0.9)
    single = (ResponsePoint("acc_1", "transverse"), ResponsePoint("acc_2", None))
    assert not is_unresolved_pair(pair, [pair], single)


def test_an_unknown_standard_deviation_becomes_a_tenth_of_the_bandwidth() -> None:
    shape = np.array([1.0, 1.0])
    unknown = FoundMode(10.0, np.nan, 0.002, np.nan, shape, np.full(2, np.nan))
    assert blur(unknown).frequency_sd_hz == pytest.approx(0.004)


@pytest.mark.parametrize("share", [0.12, 0.17, 0.83, 0.88])
def test_both_planes_are_judged_alike(share: float) -> None:
    """15 % of the energy in the weaker plane, whichever that is."""
    pair = mode(10.0, float(np.sqrt(share)), float(np.sqrt(1 - share)))
    assert is_unresolved_pair(pair, [pair], BIAXIAL) == (0.15 < share < 0.85)
