"""Hammer tests of a hanger with planted effects, against finite elements that share no code."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.models.base import Conditions
from shm.simulate import HammerPlan, HangerState, PlantedEffect, hammer_test
from shm.simulate.effects import plant_effects
from shm.simulate.modes import make_bar, plane_modes
from shm.values import AddedMass, FloatArray, Hanger, Recording
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


def test_effects_leave_hits_as_they_are(hanger: Hanger) -> None:
    plain, clamped = (rung(hanger, *effects) for effects in ((), EFFECTS[:1]))
    assert plain.force is not None
    assert clamped.force is not None
    assert np.array_equal(plain.force.values, clamped.force.values)
    assert not np.array_equal(plain.accelerations[0].values, clamped.accelerations[0].values)


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
    effect, places = EFFECTS[5], PLAN.sensor_places_m(hanger)
    bar = make_bar(hanger, STATE, len(places))
    bar = plant_effects(bar, (effect,), Conditions(amplitude=2.0), hanger, places)
    found = plane_modes(bar, 200.0)[0].added_damping_ratio
    exact = planted_modes(hanger, STATE, (effect,), TestConditions(amplitude=2.0), 8, places)
    np.testing.assert_allclose(STATE.damping_ratio + found[:8], exact.damping_ratio[0], rtol=1e-4)
    assert exact.damping_ratio.min() > 2 * STATE.damping_ratio


def test_a_known_mass_is_clamped_on(hanger: Hanger) -> None:
    conditions = Conditions(added_mass=AddedMass(60.0, 3.4))
    found = hammer_test(hanger, STATE, PLAN, np.random.default_rng(1), conditions=conditions)
    same = rung(hanger, EFFECTS[0])
    values = (made.accelerations[0].values for made in (found, same))
    np.testing.assert_allclose(*values, atol=1e-4)  # four steps of the converter


def test_a_hammer_beyond_the_end_is_refused(hanger: Hanger) -> None:
    shorter = PlantedEffect("effective_length", "deck end", {"length_change_m": -2.2})
    with pytest.raises(UsageError, match="beyond the end"):
        rung(hanger, shorter)


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (PlantedEffect("ghost", "everywhere", {}), "no effect"),
        (PlantedEffect("load_scale", "everywhere", {"load_error": 0.1}), "no effect"),
        (PlantedEffect("point_mass", "deck end", {"mass_kg": 1.0, "x_m": 1.0}), "does not act"),
        (PlantedEffect("point_mass", "everywhere", {"mass_kg": 1.0}), "has mass_kg"),
        (
            PlantedEffect("point_mass", "everywhere", {"mass_kg": math.nan, "x_m": 1.0}),
            "is no number",
        ),
    ],
)
def test_an_effect_that_cannot_be_is_refused(
    hanger: Hanger, effect: PlantedEffect, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        rung(hanger, effect)


def test_an_effect_of_one_test_acts_in_that_test_alone(hanger: Hanger) -> None:
    clock = PlantedEffect("timebase", "test t1", {"clock_error": 0.02})
    bars = [
        plant_effects(make_bar(hanger, STATE), (clock,), Conditions(test), hanger, ())
        for test in ("t1", "t2", "")
    ]
    assert [float(bar.clock_factor[0]) for bar in bars] == [1.02, 1.0, 1.0]
