"""A clock that drifts moves all frequencies by the same share from the first hit to the last.

Recorded with a clock whose frequencies move from 1 - d/2 to 1 + d/2 over T seconds, a ring begun at
t0 has the phase 2 pi f (t + d ((t0 + t)^2 - t0^2) / (2 T) - d t / 2).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.contract import Hit
from shm.identify.estimation.drift import common_drift, hit_shares
from shm.values import Channel, QualityCheck, Recording

RATE_HZ, SLOT_S, HITS = 512.0, 6.0, 4
FREQUENCIES_HZ, DAMPING_RATIO = (9.0, 21.0, 34.0, 44.0), 0.003
SHAPES = ((1.0, 0.7), (0.8, -0.6), (0.5, 1.0), (0.9, 0.3))
FIRST_TO_LAST = (HITS - 1) / HITS
"""Of the record's length."""


def _recording(drift: float, of_one_mode: bool = False, slope: float = 0.0) -> Recording:
    """Hits grow by 10 % each: with a slope, frequencies also move from hit to hit."""
    rng = np.random.default_rng(5)
    slot, before = int(SLOT_S * RATE_HZ), int(0.4 * RATE_HZ)
    motion = 1e-3 * rng.standard_normal((2, before + HITS * slot))
    force = 0.1 * rng.standard_normal(before + HITS * slot)
    whole_s = HITS * SLOT_S
    t = np.arange(slot) / RATE_HZ
    for hit in range(HITS):
        begin = hit * slot + before
        strength = 1.0 + 0.1 * hit
        force[begin : begin + 4] += 1000 * strength * np.array([0.4, 1.0, 1.0, 0.4])
        t0 = hit * SLOT_S
        clock = ((t0 + t) ** 2 - t0**2) / (2 * whole_s) - t / 2
        for frequency_hz, shape in zip(FREQUENCIES_HZ, SHAPES, strict=True):
            decay = 2 * np.pi * frequency_hz * DAMPING_RATIO
            moved = drift if frequency_hz == FREQUENCIES_HZ[0] or not of_one_mode else 0.0
            late = t + moved * clock - slope * strength * np.expm1(-decay * t) / decay
            ring = strength * np.exp(-decay * t) * np.sin(2 * np.pi * frequency_hz * late)
            motion[:, begin : begin + slot] += np.outer(shape, ring)
    channels = [Channel("force", "force", force, None, 1.0)] + [
        Channel(f"acc_{row}", "acceleration", values, "transverse", 1.0 + row)
        for row, values in enumerate(motion)
    ]
    return Recording("made.csv", tuple(channels), RATE_HZ)


@cache
def _identified(drift: float, of_one_mode: bool = False, slope: float = 0.0) -> Identification:
    record = _recording(drift, of_one_mode, slope)
    return identify([record], IdentifyOptions(2.0, 50.0), test_id="t")


def _check(found: Identification) -> QualityCheck:
    return next(check for check in found.quality if check.name == "drift")


@pytest.mark.parametrize("drift", [-2e-3, 5e-4])
def test_what_all_modes_share_is_told_and_makes_frequencies_less_sure(drift: float) -> None:
    found = _identified(drift)
    check = _check(found)
    assert check.verdict == "warning"
    assert ("fall" if drift < 0 else "rise") in check.found
    assert check.value == pytest.approx(abs(drift) * FIRST_TO_LAST, rel=0.05)
    assert len(found.test.modes) == len(FREQUENCIES_HZ)
    for mode, frequency_hz in zip(found.test.modes, FREQUENCIES_HZ, strict=True):
        assert mode.frequency_sd_hz > 0.9 * check.value / 2 * frequency_hz
        assert abs(mode.frequency_hz - frequency_hz) < 2 * mode.frequency_sd_hz


@pytest.mark.parametrize(
    ("drift", "of_one_mode", "slope"), [(0.0, False, 0.0), (0.0, False, -1e-3), (2e-3, True, 0.0)]
)
def test_a_steady_hanger_one_that_slips_and_one_mode_alone_do_not_drift(
    drift: float, of_one_mode: bool, slope: float
) -> None:
    check = _check(_identified(drift, of_one_mode, slope))
    assert check.verdict == "good"
    assert check.value < 1e-4 or of_one_mode


def test_modes_that_differ_leave_their_mean_unsure() -> None:
    """Three alike with the standard deviation s have a mean with s / sqrt(3)."""
    alike = common_drift([1e-3, 1e-3, 1e-3], [3e-5, 3e-5, 3e-5])
    assert alike is not None
    assert alike.sure
    assert alike.change == pytest.approx(1e-3)
    assert alike.sd == pytest.approx(3e-5 / np.sqrt(3))
    apart = common_drift([1e-3, 2e-3, 0.0], [3e-5, 3e-5, 3e-5])
    assert apart is not None
    assert not apart.sure
    assert apart.sd == pytest.approx(1e-3 / np.sqrt(3), rel=0.01)
    assert common_drift([1e-3, 1e-3], [1e-5, 1e-5]) is None


def test_hits_are_placed_by_their_moments_or_over_several_records_by_their_number() -> None:
    hits = [Hit(0, 0, at_s, 1.0) for at_s in (1.0, 2.0, 5.0)]
    assert hit_shares(hits) == pytest.approx([-0.5, -0.25, 0.5])
    apart = [Hit(record, 0, 1.0, 1.0) for record in range(3)]
    assert hit_shares(apart) == pytest.approx([-0.5, 0.0, 0.5])
    assert not np.any(hit_shares(hits[:1]))
