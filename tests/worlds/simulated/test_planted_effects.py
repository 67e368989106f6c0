"""Each effect that can be planted, against a closed form, another way to say it, or a limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.simulate import HangerState, PlantedEffect
from shm.values import AddedMass, FloatArray, Hanger
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.effects.registry import PLANTED, choices, drawn, ranges_of
from tests.worlds.simulated.elements import natural_frequencies, plane_modes
from tests.worlds.simulated.planted import PlantedModes

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

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
