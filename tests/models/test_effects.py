"""Every effect of the catalogue: declared fully, gone at zero, there otherwise."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import numpy as np
import pytest

from shm.models.effects import (
    EFFECTS,
    Case,
    Conditions,
    Survey,
    Variant,
    parameters_of,
)
from shm.models.hanger import PhysicalHanger
from shm.values import PLANES
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


def at_size(name: str, variant: Variant, zero: bool, shares: np.ndarray = SHARES) -> np.ndarray:
    """Values (n, parameters), every size at its zero where asked for."""
    return np.stack(
        [
            np.full(len(shares), one.zero) if zero and not np.isnan(one.zero) else one.value(shares)
            for one in parameters_of(name, HANGER_3, variant)
        ],
        axis=1,
    )


def acting(
    name: str,
    variant: Variant,
    conditions: Conditions = CONDITIONS,
    zero: bool = False,
    shares: np.ndarray = SHARES,
) -> PhysicalHanger:
    test = variant.test or conditions.test
    values = at_size(name, variant, zero, shares)
    case = Case(HANGER_3, variant, replace(conditions, test=test))
    return EFFECTS[name].act(bar(), values, case)


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
def test_at_zero_nothing_is_changed(name: str, variant: Variant) -> None:
    assert changed(bar(), acting(name, variant, zero=True)) == set()


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_a_size_within_its_prior_changes_the_hanger(name: str, variant: Variant) -> None:
    assert changed(bar(), acting(name, variant)) != set()


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_what_an_effect_follows_is_declared(name: str, variant: Variant) -> None:
    """It may depend on the temperature or the level only where it says so."""
    usual = acting(name, variant)
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
