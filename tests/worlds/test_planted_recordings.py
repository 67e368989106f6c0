"""Hammer tests of a hanger with planted effects, against finite elements that share no code."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.simulate import HammerPlan, HangerState, PlantedEffect, hammer_test
from shm.values import Hanger, Recording
from tests.helpers.hangers import HANGER_3
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.hammer import hammer_test as hit_elements


@pytest.fixture
def hanger() -> Hanger:
    """Return a round bar like hanger 3 of the thesis."""
    return replace(HANGER_3, plate=None)


STATE = HangerState(711e3)
PLAN = HammerPlan(hits=1, seconds_per_hit=16.0)
EFFECTS = (
    PlantedEffect("point_mass", "everywhere", {"mass_kg": 60.0, "x_m": 3.4}),
    PlantedEffect("shear_and_rotary_inertia", "everywhere", {"share": 1.5}),
    PlantedEffect("effective_length", "deck end", {"length_change_m": -0.6}),
    PlantedEffect("sag", "everywhere, transverse", {"sag_parameter": 8.0}),
    PlantedEffect(
        "support_motion",
        "arch end, longitudinal",
        {"support_mass_kg": 5000.0, "support_frequency_hz": 30.0},
    ),
    PlantedEffect("joint_softening", "both ends", {"log10_k_at_reference_level": 7.5}),
    PlantedEffect("skewed_principal_axes", "both ends", {"log10_k": 6.5, "angle_deg": 30.0}),
    PlantedEffect("timebase", "all tests", {"clock_error": 0.02}),
)


def rung(hanger: Hanger, *effects: PlantedEffect, plan: HammerPlan = PLAN) -> Recording:
    return hammer_test(hanger, STATE, plan, np.random.default_rng(1), effects=effects)


def peak(recording: Recording, channel: int, near_hz: float) -> float:
    """The strongest line within 2 % of a frequency, from a long, padded transform."""
    values = recording.accelerations[channel].values
    padded = 16 * len(values)
    lines = np.abs(np.fft.rfft(values * np.hanning(len(values)), padded))
    frequency = np.fft.rfftfreq(padded, 1 / recording.sampling_rate_hz)
    near = np.abs(frequency / near_hz - 1) < 0.02
    return float(frequency[near][np.argmax(lines[near])])


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_the_hanger_rings_at_its_planted_frequencies(hanger: Hanger, effect: PlantedEffect) -> None:
    recording = rung(hanger, effect)
    assert recording.sampling_rate_hz == pytest.approx(512.0)
    assert recording.samples == PLAN.samples
    places = PLAN.sensor_places_m(hanger)
    planted = planted_modes(hanger, STATE, (effect,), TestConditions(), 3, places).frequency_hz
    for plane in (0, 1):
        for order in (1, 2):
            exact = planted[plane, order]
            assert peak(recording, 2 + plane, exact) == pytest.approx(exact, rel=7e-4)


SPRINGS = HangerState(650e3, 1e7, 1e7, 3e7, 3e7, damping_ratio=0.003)
HINGED = HangerState(650e3, 1e7, 3e7, 0.0, damping_ratio=0.003, length_m=11.5)
# All but the support that moves, whose own mode the general model leaves out.
COMPARED = [(SPRINGS, each) for each in EFFECTS if each.name != "support_motion"]


@pytest.mark.parametrize(("state", "effect"), [(HINGED, None), *COMPARED])
def test_a_recording_agrees_with_finite_elements(
    hanger: Hanger, state: HangerState, effect: PlantedEffect | None
) -> None:
    """Over the first second, where errors of 1e-5 in the frequencies do not yet turn phases."""
    plan = HammerPlan(hits=1, seconds_per_hit=1.5, acceleration_noise_m_s2=0.0, force_noise_n=0.0)
    planted = (effect,) if effect else ()
    found, exact = (
        make(hanger, state, plan, np.random.default_rng(1), effects=planted)
        for make in (hammer_test, hit_elements)
    )
    assert found.sampling_rate_hz == pytest.approx(exact.sampling_rate_hz, rel=1e-12)
    for one, other in zip(found.channels, exact.channels, strict=True):
        scale = np.abs(other.values).max()
        np.testing.assert_allclose(one.values, other.values, atol=5e-3 * scale)


def test_turned_sensors_mix_the_channels(hanger: Hanger) -> None:
    plan = HammerPlan(
        hits=1, seconds_per_hit=4.0, hammer_angle_deg=0.0, acceleration_noise_m_s2=0.0
    )
    turned = PlantedEffect("sensor_misalignment", "all sensors", {"angle_deg": 10.0})
    first, second = (each.values for each in rung(hanger, turned, plan=plan).accelerations[:2])
    straight = rung(hanger, plan=plan).accelerations[0].values
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    scale = np.abs(straight).max()
    np.testing.assert_allclose(first, c * straight, atol=2e-3 * scale)
    np.testing.assert_allclose(second, -s * straight, atol=2e-3 * scale)
