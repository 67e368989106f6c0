"""A unit that is wrong by 1000, and an accelerometer in the hammer's place: said; sound tests: not.

`tests/benchmarks/right_signals.py` counts both over hangers and crews of all kinds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify.plausibility import apparent_mass_kg, ringing, signal_doubts
from shm.simulate.state import HammerPlan, HangerState
from shm.values import Recording
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.hammer import hammer_test

ROD = replace(HANGER_3, plate=None)
PLAN = HammerPlan(hits=3, seconds_per_hit=8.0)


def a_recording(seed: int = 1, **plan: float) -> Recording:
    state = HangerState(711e3, 1e7, 1e7, 1e7, 1e7)
    changed = replace(PLAN, **plan)  # type: ignore[arg-type]
    return hammer_test(ROD, state, changed, np.random.default_rng(seed))


SOUND = a_recording()
ACCELERATIONS = tuple(channel.name for channel in SOUND.accelerations)


def times(factor: float, *names: str) -> Recording:
    """Return the recording with some channels in a wrong unit."""
    channels = (
        replace(c, values=c.values * factor) if c.name in names else c for c in SOUND.channels
    )
    return replace(SOUND, channels=tuple(channels))


def test_a_sound_test_is_not_doubted_and_weighs_about_what_the_hanger_does() -> None:
    """J/v lies near the mass of the bar, 1242 kg, whatever tension and ends."""
    assert signal_doubts([SOUND], ROD) == ()
    assert signal_doubts([SOUND]) == ()
    whole_kg = ROD.mass_per_length_kg_m * ROD.length_m
    assert 0.2 < apparent_mass_kg(SOUND) / whole_kg < 5


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_a_unit_that_is_wrong_by_1000_is_doubted_by_the_mass_of_the_hanger(factor: float) -> None:
    for names in (("force",), ACCELERATIONS):
        (doubt,) = signal_doubts([times(factor, *names)], ROD)
        assert doubt.kind == "unit"
        assert "right unit" in doubt.text


@pytest.mark.parametrize("lost_hits", [1, 3])
def test_apparent_mass_lost_samples(lost_hits: int) -> None:
    """A channel that lost the ring-down of some hits is judged by the others, or not at all."""
    name, samples = ACCELERATIONS[0], SOUND.samples
    lost = np.arange(samples) < lost_hits * samples / PLAN.hits
    holes = tuple(
        replace(c, values=np.where(lost, np.nan, c.values)) if c.name == name else c
        for c in SOUND.channels
    )
    record = replace(SOUND, channels=holes)
    assert signal_doubts([record], ROD) == ()
    assert apparent_mass_kg(record) == pytest.approx(apparent_mass_kg(SOUND), rel=0.5)


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_one_sensor_in_another_unit_is_named(factor: float) -> None:
    for name in ACCELERATIONS:
        found = signal_doubts([times(factor, name)], ROD)
        assert name in [doubt.channel for doubt in found]


@pytest.mark.parametrize("name", ACCELERATIONS)
def test_an_accelerometer_in_the_hammers_place_is_doubted_and_the_hammer_named(name: str) -> None:
    values = {channel.name: channel.values for channel in SOUND.channels}
    crossed = {"force": name, name: "force"}
    channels = tuple(replace(c, values=values[crossed.get(c.name, c.name)]) for c in SOUND.channels)
    (doubt,) = signal_doubts([replace(SOUND, channels=channels)], ROD)
    assert (doubt.kind, doubt.channel) == ("channels", "force")
    assert f"{name} is over as a hammer's force is" in doubt.text


def test_ambient_records_and_dead_channels_are_left_to_other_checks() -> None:
    ambient = replace(SOUND, channels=SOUND.accelerations)
    assert signal_doubts([ambient], ROD) == ()
    dead = times(0.0, ACCELERATIONS[0])
    assert signal_doubts([dead], ROD) == ()
    assert np.isinf(ringing(np.full(100, np.nan), 100.0))
    assert np.isnan(apparent_mass_kg(ambient))
