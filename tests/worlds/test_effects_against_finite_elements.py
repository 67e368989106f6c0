"""The catalogue of effects on the general model against the simulator's finite elements.

The two share no code: elements of cubic or Timoshenko shape functions there, a Galerkin basis
here; each effect's physics was written down twice.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.models import MODELS, AsMade
from shm.models.effects import EFFECTS, Conditions, Survey, Variant
from shm.simulate import HangerState, PlantedEffect
from shm.values import PLANES, AddedMass, FloatArray, Hanger, Turnbuckle
from tests.helpers.planted_modes import planted_modes
from tests.worlds.simulated.effects.base import TestConditions, where_of
from tests.worlds.simulated.effects.registry import PLANTED, choices, ranges_of
from tests.worlds.simulated.reality import GLOBAL, Deviations

PLACES = (1.56, 3.48, 5.4, 7.92)
MODES = 8
ADDED = AddedMass(25.0, 3.6, 0.0)
WARM_AND_HARD = ("t1", 12.0, 1.7, ADDED)
DEVIATIONS = Deviations(0.004, -0.006, 0.003, 0.005)
DIAMETER = 0.130

# Middling values of the sizes and of where and how; an effect that stands in neither table is tried
# at a half and at nine tenths of its ranges.
VALUES = {
    "rotational_end_flexibility": {"log10_k": 7.2},
    "translational_end_flexibility": {"log10_kt": 8.0},
    "effective_length": {"length_change_m": -0.15},
    "bending_stiffness": {"stiffness_change": -0.15},
    "distributed_mass": {"mass_change": 0.05},
    "point_mass": {"mass_kg": 12.0, "x_m": 3.4},
    "section_loss": {"loss": 0.15, "x_m": 2.3, "extent_m": 0.9},
    "stiff_end_zones": {"zone_m": 0.3, "stiffness_ratio": 15.0},
    "shear_and_rotary_inertia": {"share": 1.0},
    "sag": {"sag_parameter": 1.0},
    "intermediate_support": {"stiffness_n_m": 4e4, "x_m": 4.1},
    "support_motion": {"support_mass_kg": 8000.0, "support_frequency_hz": 9.0},
    "temperature_tension": {"tension_per_kelvin_n_k": -900.0},
    "geometric_hardening": {"hardening": 0.004},
    "joint_softening": {"log10_k_at_reference_level": 7.3},
    "sensor_mass": {"mass_kg": 2.0},
    "sensor_misalignment": {"angle_deg": 8.0},
    "skewed_principal_axes": {"log10_k": 7.2, "angle_deg": 25.0},
    "timebase": {"clock_error": 0.002},
    "section_size": {"diameter_change": 0.03},
    "partial_mass": {"mass_change": 0.05, "x_m": 3.0, "extent_m": 6.0},
}
CASES = [(name, at) for name in PLANTED for at in choices(name, PLACES, ("t1",), round_bar=False)]
STRONG = {
    "rotational_end_flexibility": {"log10_k": 5.6},
    "translational_end_flexibility": {"log10_kt": 6.2},
    "effective_length": {"length_change_m": 1.2},
    "bending_stiffness": {"stiffness_change": 0.7},
    "distributed_mass": {"mass_change": 0.3},
    "point_mass": {"mass_kg": 120.0, "x_m": 5.0},
    "section_loss": {"loss": 0.55, "x_m": 9.0, "extent_m": 4.0},
    "stiff_end_zones": {"zone_m": 1.3, "stiffness_ratio": 80.0},
    "shear_and_rotary_inertia": {"share": 1.5},
    "sag": {"sag_parameter": 18.0},
    "intermediate_support": {"stiffness_n_m": 4e6, "x_m": 2.9},
    "support_motion": {"support_mass_kg": 700.0, "support_frequency_hz": 30.0},
    "temperature_tension": {"tension_per_kelvin_n_k": 20e3},
    "geometric_hardening": {"hardening": 0.05},
    "joint_softening": {"log10_k_at_reference_level": 6.0},
    "sensor_mass": {"mass_kg": 18.0},
    "sensor_misalignment": {"angle_deg": -50.0},
    "skewed_principal_axes": {"log10_k": 6.0, "angle_deg": -70.0},
    "timebase": {"clock_error": -0.04},
    "section_size": {"diameter_change": -0.12},
    "partial_mass": {"mass_change": 0.9, "x_m": 9.5, "extent_m": 7.0},
}

# Where the general model's functions are too few for the highest orders, measured on refined
# elements: the slope's kink at a mass in a bar that shears, and zones of much other stiffness.
LOOSER = {"shear_and_rotary_inertia": 3e-5}
STRONG_TOLERANCE = {
    "section_loss": (2e-5, 2e-3),
    "stiff_end_zones": (5e-5, 1e-2),
    "shear_and_rotary_inertia": (5e-5, 2e-3),
}


@pytest.fixture
def hanger() -> Hanger:
    """Like hanger 3, but nobody says that it is round."""
    area = math.pi * DIAMETER**2 / 4
    return Hanger(
        id=3,
        length_m=12.0,
        elastic_modulus_pa=200e9,
        area_m2=area,
        second_moment_m4=math.pi * DIAMETER**4 / 64,
        mass_per_length_kg_m=7800 * area,
        nominal_tension_n=711e3,
    )


def planted(
    hanger: Hanger, name: str, at: str, values: dict[str, float] | None, share: float = 0.5
) -> PlantedEffect:
    """The values by the names that the effect gives them at this place (log10_k1, log10_k3).

    Without any they lie at a share of the way from the weakest to the strongest.
    """
    ranges = PLANTED[name].ranges(hanger, where_of(at))
    if values is None:
        return PlantedEffect(name, at, {each: own.value(share) for each, own in ranges.items()})
    names = list(ranges)
    step = {each: 0.3 * index for index, each in enumerate(names)}
    given = {
        each: values[each] if each in values else values[each.rstrip("1234")] + step[each]
        for each in names
    }
    return PlantedEffect(name, at, given)


def variant_of(name: str, at: str, hanger: Hanger) -> Variant:
    survey = Survey(("t1", "t2"), PLANES, PLACES, True, (0.0, 12.0), (1.0, 1.7), (ADDED,))
    (found,) = [each for each in EFFECTS[name].variants(hanger, survey) if each.at == at]
    return found


def plain(baseline: str, hanger: Hanger) -> AsMade:
    """Make the class without the terms that the simulator does not have."""
    return AsMade(MODELS[baseline](hanger), with_terms=False)


def both(
    hanger: Hanger,
    *effects: PlantedEffect,
    baseline: str = "beam1",
    springs: tuple[float, ...] = (),
    made: Deviations = DEVIATIONS,
) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
    """Frequencies, shapes and damping that the joints add: general model, finite elements."""
    acting = [(each.name, variant_of(each.name, each.at, hanger)) for each in effects]
    model = plain(baseline, hanger).with_effects(acting, PLACES)
    tension = 1.05 * hanger.nominal_tension_n
    section, density, length, modulus = (getattr(made, name) for name in GLOBAL)
    own = [value for each in effects for value in each.values.values()]
    theta = np.array([[1.05, 1 + length, *springs, *np.log1p([section, density, modulus]), *own]])
    test, shift, level, mass = WARM_AND_HARD
    found = model.modes(theta, Conditions(test, shift, level, mass), MODES)
    k1, k2, k3, k4 = (10.0**k for k in springs) if springs else (math.inf,) * 4
    state = HangerState(tension, k1, k2, k3, k4, damping_ratio=0.0)
    conditions = TestConditions(test, shift, level, mass)
    truth = planted_modes(hanger, state, effects, conditions, MODES, PLACES, deviations=made)
    return (
        (found.frequency_hz[0], found.shape[0], found.damping_ratio[0]),
        (truth.frequency_hz, truth.shape, truth.damping_ratio),
    )


def assert_alike(
    found: tuple[FloatArray, ...], truth: tuple[FloatArray, ...], frequency: float, shape: float
) -> None:
    np.testing.assert_allclose(found[0], truth[0], rtol=frequency)
    sign = np.sign(np.sum(found[1] * truth[1], axis=(2, 3), keepdims=True))
    np.testing.assert_allclose(sign * found[1], truth[1], atol=shape)
    np.testing.assert_allclose(found[2], truth[2], rtol=1e-3, atol=1e-7)


def test_every_effect_of_the_catalogue_can_be_planted(hanger: Hanger) -> None:
    """Same names, same places, same parameters in the same order.

    Springs that are alike in both planes are planted as two of one size.
    """
    assert set(PLANTED) == set(EFFECTS) - {"load_scale"}  # no simulated campaign reads a tension
    survey = Survey(("t1",), PLANES, PLACES, True, (0.0, 12.0), (1.0, 1.7), (ADDED,))
    for name in PLANTED:
        effect = EFFECTS[name]
        for variant in effect.variants(hanger, survey):
            if variant.isotropic:
                continue
            assert variant.at in choices(name, PLACES, ("t1",), round_bar=False)
            parameters = [each.name for each in effect.parameters(hanger, variant)]
            assert parameters == list(PLANTED[name].ranges(hanger, where_of(variant.at)))


def test_ranges_are_those_of_the_catalogue(hanger: Hanger) -> None:
    for name, at in CASES:
        effect = planted(hanger, name, at, VALUES.get(name))
        ranges = ranges_of(effect, hanger)
        for known in EFFECTS[name].parameters(hanger, variant_of(name, at, hanger)):
            own = ranges[known.name]
            np.testing.assert_allclose(
                sorted([own.weak, own.strong]), [known.lower, known.upper], rtol=1e-6
            )
            np.testing.assert_equal(own.zero, known.zero)
            assert own.signed == known.signed


@pytest.mark.parametrize(("name", "at"), CASES)
def test_a_middling_effect_is_the_same_by_both(hanger: Hanger, name: str, at: str) -> None:
    effect = planted(hanger, name, at, VALUES.get(name))
    assert_alike(*both(hanger, effect), frequency=LOOSER.get(name, 1e-5), shape=1e-3)


@pytest.mark.parametrize("name", PLANTED)
def test_a_strong_effect_is_the_same_by_both(hanger: Hanger, name: str) -> None:
    at = choices(name, PLACES, ("t1",), round_bar=False)[-1]
    effect = planted(hanger, name, at, STRONG.get(name), share=0.9)
    frequency, shape = STRONG_TOLERANCE.get(name, (1e-5, 1e-3))
    assert_alike(*both(hanger, effect), frequency=frequency, shape=shape)


def test_end_springs_of_the_baseline_are_those_of_the_state(hanger: Hanger) -> None:
    assert_alike(
        *both(hanger, baseline="beam2", springs=(6.8, 7.3, 7.1, 6.6)), frequency=1e-5, shape=1e-3
    )


def test_two_effects_act_together(hanger: Hanger) -> None:
    one = planted(hanger, "point_mass", "everywhere", VALUES["point_mass"])
    other = planted(hanger, "skewed_principal_axes", "arch end", VALUES["skewed_principal_axes"])
    third = planted(hanger, "stiff_end_zones", "deck end", VALUES["stiff_end_zones"])
    assert_alike(*both(hanger, one, other, third), frequency=1e-5, shape=1e-3)


def test_a_long_slender_hanger_with_turnbuckles_is_the_same_by_both(hanger: Hanger) -> None:
    """Of a bar as described: as made, a turnbuckle is as much stiffer as its bar in one alone."""
    slender = replace(
        hanger,
        length_m=30.0,
        second_moment_m4=hanger.second_moment_m4 / 4,
        turnbuckles=(Turnbuckle(2.0, 0.5, 80.0, 4e6),),
    )
    effect = planted(slender, "point_mass", "everywhere", VALUES["point_mass"])
    found = both(slender, effect, made=Deviations())
    assert_alike(*found, frequency=3e-5, shape=2e-3)
