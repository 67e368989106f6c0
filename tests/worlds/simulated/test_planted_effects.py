"""Each effect that can be planted, against a closed form, another way to say it, or a limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.simulate import HangerState, PlantedEffect
from shm.values import AddedMass, FloatArray, Hanger, Turnbuckle
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.effects.registry import PLANTED, choices, drawn, ranges_of
from tests.worlds.simulated.elements import natural_frequencies, plane_modes
from tests.worlds.simulated.planted import PlantedModes

MODES = 8
PLACES = (1.56, 3.48, 5.4, 7.92)
CLAMPED = HangerState(711e3)
USUAL = TestConditions("t1")


def modes(
    hanger: Hanger,
    effect: PlantedEffect | None = None,
    state: HangerState = CLAMPED,
    conditions: TestConditions = USUAL,
) -> PlantedModes:
    return planted_modes(hanger, state, (effect,) if effect else (), conditions, MODES, PLACES)


def frequencies(
    hanger: Hanger,
    name: str,
    at: str = "everywhere",
    state: HangerState = CLAMPED,
    conditions: TestConditions = USUAL,
    **values: float,
) -> FloatArray:
    return modes(hanger, PlantedEffect(name, at, values), state, conditions).frequency_hz


def pinned(hanger: Hanger, tension: float = 711e3, length_m: float = 12.0) -> FloatArray:
    wave_number = np.arange(1, MODES + 1) * np.pi / length_m
    bending = hanger.bending_stiffness_n_m2
    square = bending * wave_number**4 + tension * wave_number**2
    return np.sqrt(square / hanger.mass_per_length_kg_m) / (2 * np.pi)


HINGED = HangerState(711e3, 0, 0, 0, 0)


@pytest.mark.parametrize("name", PLANTED)
def test_an_effect_without_size_is_no_effect(hanger: Hanger, name: str) -> None:
    """Zero size gives the same numbers, whatever the other parameters and conditions."""
    conditions = TestConditions("t1", 10.0, 2.0, AddedMass(25.0, 3.6))
    plain = modes(hanger, conditions=conditions)
    for at in choices(name, PLACES, ("t1",)):
        effect = drawn(name, at, hanger, np.random.default_rng(1))
        zero = {key: each.zero for key, each in ranges_of(effect, hanger).items() if each.is_size}
        found = modes(
            hanger, replace(effect, values={**effect.values, **zero}), conditions=conditions
        )
        np.testing.assert_allclose(found.frequency_hz, plain.frequency_hz, rtol=1e-9)
        np.testing.assert_allclose(found.shape, plain.shape, atol=1e-8)
        np.testing.assert_allclose(found.damping_ratio, plain.damping_ratio, rtol=1e-9)


@pytest.mark.parametrize("name", [each for each in PLANTED if each != "skewed_principal_axes"])
def test_a_tiny_effect_is_next_to_none(hanger: Hanger, name: str) -> None:
    """No jump at zero, but for skewed axes: equal planes have no directions of their own."""
    for at in choices(name, PLACES, ("t1",)):
        effect = drawn(name, at, hanger, np.random.default_rng(2))
        tiny = {
            key: 1e-7 * each.weak if each.zero == 0 else each.weak * (1e5 if "mass" in key else 1.6)
            for key, each in ranges_of(effect, hanger).items()
            if each.is_size
        }
        found = modes(hanger, replace(effect, values={**effect.values, **tiny}))
        np.testing.assert_allclose(found.frequency_hz, modes(hanger).frequency_hz, rtol=2e-6)
        np.testing.assert_allclose(found.shape, modes(hanger).shape, atol=1e-4)


def test_rotational_springs_are_those_of_the_state(hanger: Hanger) -> None:
    state = HangerState(711e3, 10**6.8, 10**7.3, 10**6.8, 10**7.3)
    name = "rotational_end_flexibility"
    found = frequencies(hanger, name, "both ends", log10_k1=6.8, log10_k2=7.3)
    np.testing.assert_allclose(found, natural_frequencies(hanger, state, MODES), rtol=1e-6)
    found = frequencies(hanger, name, "arch end, longitudinal", log10_k4=7.0)
    state = HangerState(711e3, k4_n_m_rad=1e7)
    np.testing.assert_allclose(found, natural_frequencies(hanger, state, MODES), rtol=1e-6)


def test_springs_of_an_effect_and_of_the_state_act_one_after_the_other(hanger: Hanger) -> None:
    found = frequencies(
        hanger,
        "rotational_end_flexibility",
        "deck end, transverse",
        HangerState(711e3, k1_n_m_rad=2e7),
        log10_k1=math.log10(2e7),
    )
    state = HangerState(711e3, k1_n_m_rad=1e7)
    np.testing.assert_allclose(found, natural_frequencies(hanger, state, MODES), rtol=1e-6)


def test_a_translational_spring_lowers_frequencies_by_the_ends_reaction(hanger: Hanger) -> None:
    """First order: the end's shear force V of the mass-normalised mode; omega^2 falls by V^2/k.

    V = EI w''' at a clamped end, got here from two stiff springs: w falls as 1/k.
    """
    plain = modes(hanger).frequency_hz[0]
    drops = []
    for spring in (1e10, 2e10):
        name, at = "translational_end_flexibility", "arch end, transverse"
        found = frequencies(hanger, name, at, log10_kt3=math.log10(spring))
        np.testing.assert_allclose(found[1], plain, rtol=1e-9)
        drops.append(1 - (found[0] / plain) ** 2)
    np.testing.assert_allclose(drops[0] / drops[1], 2.0, rtol=0.02)
    stiffness, h = hanger.bending_stiffness_n_m2, 0.01
    near = plane_modes(hanger, CLAMPED, "transverse", MODES).at(12.0 - h * np.arange(5))
    third = (near[4] - 6 * near[3] / 1 + 12 * near[2] - 10 * near[1] + 3 * near[0]) / (2 * -(h**3))
    force = stiffness * third
    np.testing.assert_allclose(drops[0] * (2 * np.pi * plain) ** 2, force**2 / 1e10, rtol=0.05)


def test_a_length_that_changes_at_both_ends_is_that_of_a_longer_bar(hanger: Hanger) -> None:
    found = frequencies(hanger, "effective_length", "both ends", HINGED, length_change_m=-0.5)
    np.testing.assert_allclose(found[0], pinned(hanger, length_m=11.5), rtol=2e-6)
    shifted = modes(hanger, PlantedEffect("effective_length", "deck end", {"length_change_m": 0.3}))
    longer = planted_modes(
        hanger, HangerState(711e3, length_m=12.3), (), USUAL, MODES, [x + 0.3 for x in PLACES]
    )
    np.testing.assert_allclose(shifted.shape, longer.shape, atol=1e-5)


def test_bending_stiffness_changes_by_the_fraction_in_its_plane(hanger: Hanger) -> None:
    softer = replace(hanger, second_moment_m4=0.7 * hanger.second_moment_m4)
    found = frequencies(
        hanger, "bending_stiffness", "everywhere, longitudinal", HINGED, stiffness_change=-0.3
    )
    np.testing.assert_allclose(found, [pinned(hanger), pinned(softer)], rtol=2e-6)


def test_distributed_mass_lowers_all_frequencies_alike(hanger: Hanger) -> None:
    found = frequencies(hanger, "distributed_mass", mass_change=0.21)
    np.testing.assert_allclose(found, modes(hanger).frequency_hz / 1.1, rtol=1e-9)


def test_point_masses_and_known_masses_lower_frequencies_by_their_kinetic_energy(
    hanger: Hanger,
) -> None:
    """First order: f falls by the fraction m w(x)^2/2 of the mass-normalised mode."""
    plain = modes(hanger).frequency_hz
    moved = plane_modes(hanger, CLAMPED, "transverse", MODES).at(np.array([3.4]))[0]
    for found in (
        frequencies(hanger, "point_mass", mass_kg=0.01, x_m=3.4),
        modes(hanger, conditions=TestConditions(added_mass=AddedMass(0.01, 3.4))).frequency_hz,
    ):
        np.testing.assert_allclose(1 - found[0] / plain[0], 0.005 * moved**2, rtol=1e-3, atol=2e-8)


def test_section_lost_all_along_is_a_thinner_bar(hanger: Hanger) -> None:
    """EI by the square of the area that is left, mass by the area."""
    found = frequencies(hanger, "section_loss", state=HINGED, loss=0.2, x_m=6.0, extent_m=12.0)
    thinner = replace(
        hanger,
        second_moment_m4=0.64 * hanger.second_moment_m4,
        mass_per_length_kg_m=0.8 * hanger.mass_per_length_kg_m,
    )
    np.testing.assert_allclose(found[0], pinned(thinner), rtol=2e-6)


def test_section_lost_locally_is_a_turnbuckle_of_less_stiffness_and_mass(hanger: Hanger) -> None:
    mass, bending = hanger.mass_per_length_kg_m, hanger.bending_stiffness_n_m2
    worn = replace(hanger, turnbuckles=(Turnbuckle(2.5, 0.8, 0.7 * 0.8 * mass, 0.49 * bending),))
    found = frequencies(hanger, "section_loss", loss=0.3, x_m=2.5, extent_m=0.8)
    np.testing.assert_allclose(found, natural_frequencies(worn, CLAMPED, MODES), rtol=2e-6)


def test_a_stiff_end_zone_is_a_turnbuckle_at_the_end(hanger: Hanger) -> None:
    mass, bending = hanger.mass_per_length_kg_m, hanger.bending_stiffness_n_m2
    both = tuple(Turnbuckle(x, 0.9, 0.9 * mass, 20 * bending) for x in (0.45, 11.55))
    for at, buckles in (("deck end", both[:1]), ("arch end", both[1:]), ("both ends", both)):
        found = frequencies(hanger, "stiff_end_zones", at, zone_m=0.9, stiffness_ratio=20.0)
        same = replace(hanger, turnbuckles=buckles)
        np.testing.assert_allclose(found, natural_frequencies(same, CLAMPED, MODES), rtol=3e-6)


def test_shear_and_rotary_inertia_lower_frequencies_in_proportion_to_their_share(
    hanger: Hanger,
) -> None:
    """First order in a pinned bar without tension: f falls by k^2 (EI/kappa G A + I/A)/2."""
    slack = HangerState(0.0, 0, 0, 0, 0)
    plain = modes(hanger, state=slack).frequency_hz[0]
    found = frequencies(hanger, "shear_and_rotary_inertia", state=slack, share=0.01)[0]
    wave_number = np.arange(1, MODES + 1) * np.pi / hanger.length_m
    coefficient = 6 * 1.3 / (7 + 6 * 0.3)
    turning = hanger.second_moment_m4 / hanger.area_m2 * (2 * 1.3 / coefficient + 1)
    np.testing.assert_allclose(
        1 - found / plain, 0.01 * wave_number**2 * turning / 2, rtol=0.02, atol=1e-6
    )


def test_a_little_sag_lifts_odd_modes_of_its_plane_by_their_area(hanger: Hanger) -> None:
    """First order: omega^2 rises by lambda^2 T/L^3 (integral of the mode)^2, 8 lambda^2/pi^4 of a
    string's first; even modes have no area.
    """
    plain = modes(hanger, state=HINGED).frequency_hz
    found = frequencies(hanger, "sag", "everywhere, longitudinal", HINGED, sag_parameter=0.01)
    np.testing.assert_allclose(found[0], plain[0], rtol=1e-9)
    order = np.arange(1, MODES + 1)
    area = math.sqrt(2 / (hanger.mass_per_length_kg_m * 12.0)) * 2 * 12.0 / (order * np.pi)
    rise = np.where(order % 2, 0.01 * 711e3 / 12.0**3 * area**2, 0.0) / (2 * np.pi) ** 2
    np.testing.assert_allclose(found[1] ** 2 - plain[1] ** 2, rise, rtol=2e-3, atol=2e-5)


def test_a_support_at_the_middle_leaves_even_modes_alone(hanger: Hanger) -> None:
    """Odd modes rise, first order by k w(x)^2 of omega^2."""
    plain = modes(hanger).frequency_hz[0]
    at = "everywhere, transverse"
    found = frequencies(hanger, "intermediate_support", at, stiffness_n_m=500.0, x_m=6.0)
    np.testing.assert_allclose(found[1], plain, rtol=1e-7)
    np.testing.assert_allclose(found[0, 1::2], plain[1::2], rtol=1e-7)
    moved = plane_modes(hanger, CLAMPED, "transverse", MODES).at(np.array([6.0]))[0]
    rise = (found[0] ** 2 - plain**2) * (2 * np.pi) ** 2
    np.testing.assert_allclose(rise[::2], 500.0 * moved[::2] ** 2, rtol=5e-3)


def test_a_heavy_support_leaves_the_modes_as_they_are_and_is_no_mode_itself(
    hanger: Hanger,
) -> None:
    for hertz in (3.0, 40.0):
        found = frequencies(
            hanger,
            "support_motion",
            "deck end, transverse",
            support_mass_kg=1e8,
            support_frequency_hz=hertz,
        )
        np.testing.assert_allclose(found, modes(hanger).frequency_hz, rtol=1e-3)


def test_a_light_and_stiff_support_is_a_spring(hanger: Hanger) -> None:
    """Its mass of 1 g adds nothing: k = m (2 pi f)^2 remains."""
    spring = 1e8
    values = {"support_mass_kg": 1e-3, "support_frequency_hz": math.sqrt(spring / 1e-3) / 2 / np.pi}
    effect = PlantedEffect("support_motion", "arch end, longitudinal", values)
    found = planted_modes(hanger, CLAMPED, (effect,), USUAL, MODES, PLACES).frequency_hz[1]
    same = frequencies(
        hanger, "translational_end_flexibility", "arch end, longitudinal", log10_kt4=8.0
    )[1]
    np.testing.assert_allclose(found[:4], same[:4], rtol=1e-5)


def test_temperature_and_level_change_the_tension(hanger: Hanger) -> None:
    warm, hard = TestConditions(temperature_shift_k=15.0), TestConditions(amplitude=2.0)
    found = frequencies(
        hanger, "temperature_tension", conditions=warm, tension_per_kelvin_n_k=-2000.0
    )
    same = modes(hanger, state=HangerState(681e3)).frequency_hz
    np.testing.assert_allclose(found, same, rtol=1e-9)
    found = frequencies(hanger, "geometric_hardening", conditions=hard, hardening=0.01)
    same = modes(hanger, state=HangerState(711e3 * 1.04)).frequency_hz
    np.testing.assert_allclose(found, same, rtol=1e-9)


def test_joints_soften_with_the_level_and_damp_by_their_share_of_strain_energy(
    hanger: Hanger,
) -> None:
    """k falls as 1/a; the loss factor 0.1 a times d ln omega/d ln k is the damping that it adds."""
    hard = TestConditions(amplitude=2.0)
    effect = PlantedEffect("joint_softening", "both ends", {"log10_k_at_reference_level": 7.0})
    found = modes(hanger, effect, conditions=hard)
    softer, stiffer = (
        natural_frequencies(hanger, HangerState(711e3, k, k, k, k), MODES)
        for k in (5e6 * 0.99, 5e6 / 0.99)
    )
    middle = natural_frequencies(hanger, HangerState(711e3, 5e6, 5e6, 5e6, 5e6), MODES)
    np.testing.assert_allclose(found.frequency_hz, middle, rtol=1e-6)
    slope = np.log(stiffer / softer) / (-2 * np.log(0.99))
    np.testing.assert_allclose(found.damping_ratio - 0.001, 0.2 * slope, rtol=1e-3)


def test_sensors_weigh_where_they_sit(hanger: Hanger) -> None:
    masses = [
        PlantedEffect("point_mass", "everywhere", {"mass_kg": 3.0, "x_m": place})
        for place in PLACES
    ]
    same = planted_modes(hanger, CLAMPED, masses, USUAL, MODES, PLACES)
    found = modes(hanger, PlantedEffect("sensor_mass", "all sensors", {"mass_kg": 3.0}))
    np.testing.assert_allclose(found.frequency_hz, same.frequency_hz, rtol=1e-9)


def test_a_turned_sensor_sees_both_components_of_a_plane_mode(hanger: Hanger) -> None:
    plain = modes(hanger)
    at = "sensor at 3.48 m"
    found = modes(hanger, PlantedEffect("sensor_misalignment", at, {"angle_deg": 20.0}))
    np.testing.assert_allclose(found.frequency_hz, plain.frequency_hz, rtol=1e-9)
    ratio = found.shape[0, :, 1, 1] / found.shape[0, :, 1, 0]
    np.testing.assert_allclose(ratio, -math.tan(math.radians(20)), rtol=1e-9)
    ratio = found.shape[1, :, 1, 0] / found.shape[1, :, 1, 1]
    np.testing.assert_allclose(ratio, math.tan(math.radians(20)), rtol=1e-9)
    assert np.all(found.shape[0, :, [0, 2, 3], 1] == 0)


def test_skewed_axes_turn_the_modes_into_their_direction(hanger: Hanger) -> None:
    """Along the axis both ends turn on springs, across it they are clamped."""
    effect = PlantedEffect("skewed_principal_axes", "both ends", {"log10_k": 6.9, "angle_deg": 25})
    found = modes(hanger, effect)
    sprung = natural_frequencies(hanger, HangerState(711e3, *[10**6.9] * 4), MODES)[0]
    clamped = natural_frequencies(hanger, CLAMPED, MODES)[1]
    np.testing.assert_allclose(found.frequency_hz, [sprung, clamped], rtol=2e-6)
    np.testing.assert_allclose(
        found.shape[0, ..., 1] / found.shape[0, ..., 0], math.tan(math.radians(25)), rtol=1e-3
    )


def test_a_clock_that_errs_scales_the_frequencies_of_its_tests(hanger: Hanger) -> None:
    plain = modes(hanger).frequency_hz
    for at, factor in (("all tests", 1.01), ("test t1", 1.01), ("test t2", 1.0)):
        found = frequencies(hanger, "timebase", at, clock_error=0.01)
        np.testing.assert_allclose(found, factor * plain, rtol=1e-9)


def test_effects_act_together(hanger: Hanger) -> None:
    heavier = PlantedEffect("distributed_mass", "everywhere", {"mass_change": 0.21})
    fast = PlantedEffect("timebase", "all tests", {"clock_error": 0.1})
    found = planted_modes(hanger, CLAMPED, (heavier, fast), USUAL, MODES, PLACES)
    np.testing.assert_allclose(found.frequency_hz, modes(hanger).frequency_hz, rtol=1e-9)


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (PlantedEffect("ghost", "everywhere", {}), "no effect"),
        (PlantedEffect("point_mass", "somewhere", {}), "no place"),
        (PlantedEffect("point_mass", "deck end", {}), "does not act"),
        (PlantedEffect("distributed_mass", "everywhere, transverse", {}), "does not act"),
        (PlantedEffect("point_mass", "everywhere", {"mass_kg": 1.0}), "x_m"),
        (PlantedEffect("distributed_mass", "everywhere", {"mass_change": math.nan}), "no number"),
    ],
)
def test_an_effect_that_cannot_be_is_refused(
    hanger: Hanger, effect: PlantedEffect, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        modes(hanger, effect)
