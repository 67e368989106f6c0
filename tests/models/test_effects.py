"""Every effect of the catalogue: declared fully, gone at zero, there otherwise."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.models.effects import (
    EFFECTS,
    Case,
    Conditions,
    Survey,
    Variant,
    check_effect_priors,
    parameters_of,
)
from shm.models.hanger import PhysicalHanger
from shm.values import PLANES, EffectPrior, Hanger
from tests.helpers.hangers import HANGER_3

PLACES_M = (1.2, 3.6, 5.1, 8.3)
RICH = Survey(
    ("t1", "t2", "t3"), PLANES, PLACES_M, True, (2.0, 12.0, 22.0), (0.5, 1.0), (), (7e5, 7.4e5)
)
BARE = Survey(("t1",), ("transverse",), (), False, (), (), ())
CONDITIONS = Conditions("t1", temperature_shift_k=8.0, amplitude=0.7, tension_shift_n=2e4)
CASES = [
    pytest.param(name, variant, id=f"{name}@{variant.key}")
    for name, effect in EFFECTS.items()
    for variant in effect.variants(HANGER_3, RICH)
]
TENSION_N = np.array([400e3, 711e3, 900e3])
SHARES = np.array([0.2, 0.62, 0.9])


def bar() -> PhysicalHanger:
    """A hanger that has some of everything already."""
    plain = PhysicalHanger.clamped(HANGER_3, TENSION_N, sensors=len(PLACES_M))
    springy = np.broadcast_to(1e-7 * np.array([[1.0, 0.2], [0.2, 2.0]]), (3, 2, 2, 2))
    return replace(
        plain,
        rotational_compliance_rad_n_m=springy,
        joint_loss_factor=np.full((3, 2), 0.03),
        sensor_turn_rad=plain.sensor_turn_rad + 0.01,
    )


def at_size(name: str, variant: Variant, zero: bool) -> np.ndarray:
    """Values (n, parameters), every size at its zero where asked for."""
    return np.stack(
        [
            np.full(3, one.zero) if zero and not np.isnan(one.zero) else one.value(SHARES)
            for one in parameters_of(name, HANGER_3, variant)
        ],
        axis=1,
    )


def acting(
    name: str, variant: Variant, conditions: Conditions = CONDITIONS, zero: bool = False
) -> PhysicalHanger:
    case = Case(HANGER_3, variant, replace(conditions, test=variant.test or conditions.test))
    return EFFECTS[name].act(bar(), at_size(name, variant, zero), case)


def felt(physical: PhysicalHanger) -> dict[str, np.ndarray]:
    """Every array of a hanger by name; parts that change nothing are left out."""
    found = {
        field.name: getattr(physical, field.name)
        for field in fields(physical)
        if isinstance(getattr(physical, field.name), np.ndarray)
    }
    parts = {
        "zone": [
            zone
            for zone in physical.zones
            if np.any(zone.end_m > zone.start_m)
            and (np.any(zone.stiffness_factor != 1) or np.any(zone.mass_factor != 1))
        ],
        "mass": [mass for mass in physical.masses if np.any(mass.mass_kg != 0)],
        "spring": [spring for spring in physical.springs if np.any(spring.stiffness_n_m != 0)],
    }
    for kind, members in parts.items():
        for number, member in enumerate(members):
            for field in fields(member):
                found[f"{kind} {number} {field.name}"] = getattr(member, field.name)
    return found


def changed(before: PhysicalHanger, after: PhysicalHanger) -> set[str]:
    one, other = felt(before), felt(after)
    shared = one.keys() & other.keys()
    differing = {name for name in shared if not np.array_equal(one[name], other[name])}
    return differing | (one.keys() ^ other.keys())


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_says_what_it_is_and_whence(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.title
    assert effect.phrase
    assert re.search(r"\d{4}", effect.source)
    assert effect.seen_by
    assert effect.imitated_by
    assert set(effect.imitated_by) <= set(EFFECTS) - {name}
    assert (type(effect).__doc__ or "").strip().endswith(".")


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_an_effect_changes_the_hanger_by_what_it_declares(name: str, variant: Variant) -> None:
    """Nothing at zero; it follows the temperature or the level only where it says so."""
    assert changed(bar(), acting(name, variant, zero=True)) == set()
    usual = acting(name, variant)
    assert changed(bar(), usual) != set()
    warmer = acting(name, variant, replace(CONDITIONS, temperature_shift_k=-4.0))
    harder = acting(name, variant, replace(CONDITIONS, amplitude=1.5))
    follows = EFFECTS[name].follows
    assert (changed(usual, warmer) != set()) == ("temperature" in follows)
    assert (changed(usual, harder) != set()) == ("amplitude" in follows)


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_a_prior_is_a_range_with_a_reason_and_the_size_comes_first(
    name: str, variant: Variant
) -> None:
    parameters = parameters_of(name, HANGER_3, variant)
    assert not np.isnan(parameters[0].zero)
    assert len({one.name for one in parameters}) == len(parameters)
    for one in parameters:
        assert one.least <= one.lower < one.upper <= one.most
        assert one.spread == "uniform" or one.lower > 0
        assert not one.lower <= one.zero <= one.upper
        assert one.unit
        assert one.reason.endswith(".")


def test_frequencies_of_one_plane_in_one_test_show_what_they_can() -> None:
    hidden = {name for name, each in EFFECTS.items() if each.invisible(HANGER_3, BARE)}
    assert hidden == {
        "temperature_tension",
        "geometric_hardening",
        "joint_softening",
        "sensor_mass",
        "sensor_misalignment",
        "skewed_principal_axes",
        "load_scale",
    }


@pytest.mark.parametrize(
    ("name", "survey", "why"),
    [
        ("temperature_tension", replace(RICH, temperatures_c=(12.0,)), "1 K apart"),
        ("temperature_tension", replace(RICH, temperatures_c=(12.0, 12.9)), "1 K apart"),
        ("geometric_hardening", replace(RICH, amplitudes=(1.0, 1.19)), "1.2 times"),
        ("joint_softening", replace(RICH, amplitudes=()), "1.2 times"),
        ("sensor_mass", replace(RICH, sensor_places_m=()), "known places"),
        ("sensor_misalignment", replace(RICH, biaxial=False), "biaxial"),
        ("skewed_principal_axes", replace(RICH, biaxial=False), "plain end flexibility"),
        ("load_scale", replace(RICH, tensions_read_n=(7e5,)), "different tensions"),
    ],
)
def test_what_data_cannot_show_is_said_in_a_sentence(name: str, survey: Survey, why: str) -> None:
    sentence = EFFECTS[name].invisible(HANGER_3, survey)
    assert why in sentence
    assert sentence.endswith(".")


def with_prior(effect: str, parameter: str, lower: float, upper: float) -> Hanger:
    return replace(HANGER_3, effect_priors=(EffectPrior(effect, parameter, lower, upper),))


def test_the_owners_range_replaces_the_catalogues_and_nothing_else() -> None:
    own = with_prior("point_mass", "mass_kg", 1, 50)
    check_effect_priors(own)
    mass, place = parameters_of("point_mass", own, Variant())
    usual_mass, usual_place = parameters_of("point_mass", HANGER_3, Variant())
    assert (mass.lower, mass.upper) == (1, 50)
    assert replace(mass, lower=usual_mass.lower, upper=usual_mass.upper) == usual_mass
    assert place == usual_place


@pytest.mark.parametrize(
    ("prior", "complaint"),
    [
        (("magic", "size", 1, 2), r"\[hanger.effects.magic\] is no effect"),
        (("point_mass", "weight", 1, 2), r"\[hanger.effects.point_mass\] has no parameter weight"),
        (("point_mass", "mass_kg", 50, 1), r"mass_kg = \[50, 1\] does not rise"),
        (("point_mass", "mass_kg", 1, 1), "does not rise"),
        (("point_mass", "mass_kg", 0, 1), r"mass_kg = \[0, 1\] is not above 0"),
        (("timebase", "clock_error", -0.01, 0.01), "both signs"),
        (("point_mass", "x_m", 3, 13), r"Stay within 0 and 12 m"),
        (("section_loss", "loss", 0.1, 1), "Stay within 0 and 0.99 fraction"),
        (("shear_and_rotary_inertia", "share", -1, 1), "beyond what can be"),
    ],
)
def test_a_range_that_cannot_be_is_refused_with_what_to_do(prior: tuple, complaint: str) -> None:
    with pytest.raises(BadInput, match=complaint) as refusal:
        check_effect_priors(with_prior(*prior))
    assert "hanger 3" in str(refusal.value)
    assert refusal.value.remedy
