"""A hanger that knocks while it swings far is identified once it is calm, and says so."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from shm.documents import dump
from shm.identify.contract import Measurement
from shm.identify.identification import Identification
from shm.identify.setup_merging.calm_part import linear_below_level
from shm.modes_document import modes_document, parse_modes
from shm.values import Mode, ResponsePoint
from tests.helpers.struck import identified
from tests.worlds import struck_bar as world

CREW = world.Crew(hits=3, ring_s=8.0, sensors_m=(1.5, 2.9))


@pytest.fixture(scope="module")
def knocking() -> Identification:
    return identified(world.Guide(3.4, 6e5, 1.8e-5), 1.0, [2], "t1", CREW)


def test_a_guide_with_play_leaves_the_frequencies_of_small_swings(
    knocking: Identification,
) -> None:
    exact_hz = world.modes_of(world.Bar()).omega / (2 * np.pi)
    found = knocking.test.modes
    assert len(found) >= 9
    for mode in found:
        assert mode.frequency_hz == pytest.approx(exact_hz[mode.order - 1], rel=5e-4)


def test_its_test_says_above_which_level_it_knocks_and_why_a_part_was_left_out(
    knocking: Identification,
) -> None:
    test = knocking.test
    assert 0 < test.rattles_above < 0.5
    assert test.amplitude == test.rattles_above
    assert any("does not ring as a bar" in note for note in knocking.notes)
    assert (
        parse_modes(json.loads(dump(modes_document([test]))))[0].rattles_above == test.rattles_above
    )


def test_a_sound_test_says_nothing_of_it() -> None:
    found = identified(None, 1.0, [3], "t1", world.Crew(hits=3, ring_s=3.0, sensors_m=(1.5,)))
    assert np.isnan(found.test.rattles_above)
    assert "rattles_above" not in modes_document([found.test])["tests"][0]


RATE_HZ, HZ, RATIO = 128.0, (5.0, 13.0), 0.004


def _ringing(knocks: float) -> Measurement:
    """Three ring-downs; a guide stiffens the hanger by `knocks` while it swings far."""
    time_s = np.arange(1024) / RATE_HZ
    rng = np.random.default_rng(4)
    decays = []
    for _ in range(3):
        decay = 1e-3 * rng.standard_normal((2, len(time_s)))
        for hz, shape in zip(HZ, ((1.0, 0.6), (0.7, -0.5)), strict=True):
            late_s = time_s + knocks * np.minimum(time_s, 1.5)
            wave = np.exp(-2 * np.pi * hz * RATIO * time_s) * np.sin(2 * np.pi * hz * late_s)
            decay += np.outer(shape, wave)
        decays.append(decay)
    driven = tuple(np.vstack([np.zeros(len(time_s)), decay]) for decay in decays)
    points = (ResponsePoint("a"), ResponsePoint("b"))
    return Measurement("a", points, tuple(decays), RATE_HZ, None, driven=driven)


def test_ring_downs_that_begin_as_no_sum_of_modes_are_seen_whatever_acts() -> None:
    modes = [Mode("transverse", n + 1, hz, 1e-3 * hz, RATIO, 1e-3) for n, hz in enumerate(HZ)]
    assert linear_below_level([_ringing(0.0)], modes) == 1.0
    assert 0.3 < linear_below_level([_ringing(0.02)], modes) < 0.95
    few = replace(_ringing(0.02), decays=_ringing(0.02).decays[:2])
    assert linear_below_level([few], modes) == 1.0
