"""Hammer tests of a hanger with planted effects ring at the planted modes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shm.errors import UsageError
from shm.simulate import HammerPlan, HangerState, PlantedEffect
from shm.values import AddedMass, FloatArray, Hanger, Recording
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.hammer import hammer_test, simulated_test
from tests.worlds.simulated.planted import planted_bar, planted_plane_modes

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


def test_effects_leave_hits_as_they_are(hanger: Hanger) -> None:
    plain, clamped = (
        simulated_test(hanger, STATE, PLAN, np.random.default_rng(1), effects=effects)
        for effects in ((), EFFECTS[:1])
    )
    assert plain.strikes == clamped.strikes


def test_a_bar_without_size_moves_as_without_effects(hanger: Hanger) -> None:
    """The finer elements of planted bars and the plain ones give the same accelerations."""
    quiet = HammerPlan(hits=1, seconds_per_hit=4.0, acceleration_noise_m_s2=0.0)
    none = PlantedEffect("distributed_mass", "everywhere", {"mass_change": 0.0})
    plain, planted = rung(hanger, plan=quiet), rung(hanger, none, plan=quiet)
    for one, other in zip(plain.accelerations, planted.accelerations, strict=True):
        scale = np.abs(one.values).max()
        np.testing.assert_allclose(one.values, other.values, atol=2e-3 * scale)


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


def test_skewed_axes_carry_a_transverse_hit_into_the_other_plane(hanger: Hanger) -> None:
    plan = HammerPlan(hits=1, seconds_per_hit=4.0, hammer_angle_deg=0.0)

    def longitudinal(*effects: PlantedEffect) -> FloatArray:
        return rung(hanger, *effects, plan=plan).accelerations[1].values

    assert np.std(longitudinal(EFFECTS[6])) > 20 * np.std(longitudinal())


def test_joints_damp_the_modes_that_bend_them(hanger: Hanger) -> None:
    effect = EFFECTS[5]
    conditions = TestConditions(amplitude=2.0)
    bar = planted_bar(hanger, STATE, PLAN, (effect,), conditions)
    assert bar is not None
    found = planted_plane_modes(bar, hanger, STATE, PLAN, 200.0)[0].added_damping_ratio
    exact = planted_modes(hanger, STATE, (effect,), conditions, 8, PLAN.sensor_places_m(hanger))
    np.testing.assert_allclose(STATE.damping_ratio + found[:8], exact.damping_ratio[0], rtol=1e-4)
    assert exact.damping_ratio.min() > 2 * STATE.damping_ratio


def test_a_known_mass_is_clamped_on(hanger: Hanger) -> None:
    conditions = TestConditions(added_mass=AddedMass(60.0, 3.4))
    found = hammer_test(hanger, STATE, PLAN, np.random.default_rng(1), conditions=conditions)
    same = rung(hanger, EFFECTS[0])
    values = (made.accelerations[0].values for made in (found, same))
    np.testing.assert_allclose(*values, atol=1e-4)  # four steps of the converter


def test_a_hammer_beyond_the_end_is_refused(hanger: Hanger) -> None:
    shorter = PlantedEffect("effective_length", "deck end", {"length_change_m": -2.2})
    with pytest.raises(UsageError, match="beyond the end"):
        rung(hanger, shorter)
