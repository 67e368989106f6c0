"""Adopted classes: names say all of them, no effect is the baseline, conditions are followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput, UsageError
from shm.inference import UpdateOptions
from shm.models import PRIORS, THESIS, AsMade, Model, applicable, build, class_of, described
from shm.models.effects import EFFECTS, Variant
from shm.models.one_hanger.adopted import AdoptedEffect, AdoptedName, places_of
from shm.values import AddedMass, ModalTest
from tests.helpers import quick_update
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import modes_of

MASS = "beam1+point_mass@everywhere"
WARMTH = "beam1+temperature_tension@everywhere:reference_c=10"
RANGE = {"tension_per_kelvin_n_k": (-1.25e6, -1e-5)}
ADOPTABLE = [
    (name, key)
    for name, effect in EFFECTS.items()
    if effect.of_the_hanger
    for key in places_of(name, HANGER_3)[-1:]
]


def parameters(model: Model, **values: float) -> np.ndarray:
    """One parameter set (1, parameters): nominal tension, as described, but for `values`."""
    known = {"theta_F": 1.0, "theta_L": 1.0, **values}
    if isinstance(model, AsMade):
        known = {name: model.usual(name) for name in model.terms} | known
    return np.array([[known.get(name, 0.0) for name in model.parameter_names]])


@pytest.mark.parametrize(
    "name",
    [
        AdoptedName("beam1", (AdoptedEffect("point_mass", "everywhere"),)),
        AdoptedName(
            "beam2",
            (
                AdoptedEffect("effective_length", "deck_end"),
                AdoptedEffect("bending_stiffness", "everywhere.transverse"),
            ),
        ),
        AdoptedName("beam1", (AdoptedEffect("temperature_tension", "everywhere", -3.5, RANGE),)),
    ],
)
def test_a_name_comes_back_from_its_text(name: AdoptedName) -> None:
    back = AdoptedName.parse(str(name))
    assert str(back) == str(name)
    assert [(e.effect, e.key, dict(e.ranges)) for e in back.effects] == [
        (e.effect, e.key, dict(e.ranges)) for e in name.effects
    ]


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("beam1+", "EFFECT@WHERE"),
        ("+point_mass@everywhere", "no baseline"),
        ("beam1+point_mass", "EFFECT@WHERE"),
        ("beam1+point_mass@everywhere:x_m", "NAME=LOW..HIGH"),
        ("beam1+point_mass@everywhere:x_m=4..3", "rising range"),
        ("beam1+point_mass@everywhere:x_m=nan..3", "rising range"),
        ("beam1+point_mass@everywhere:reference_c=1..3", "temperature"),
        ("beam1+point_mass@everywhere:y_m=1..3", "no parameter 'y_m'"),
        ("beam9+point_mass@everywhere", "unknown model class 'beam9'"),
        ("beam1+gremlins@everywhere", "unknown effect"),
        ("beam1+point_mass@deck_end", "Places: everywhere"),
        ("beam1+timebase@test_t3", "Places: all_tests"),
        ("beam1+sensor_mass@all_sensors", "of the sensors"),
        ("beam1+temperature_tension@everywhere", "reference_c"),
    ],
)
def test_a_name_that_says_nothing_sensible_is_refused_in_words(name: str, fault: str) -> None:
    for attempt in (build, described):
        with pytest.raises(UsageError) as caught:
            attempt(name, HANGER_3)
        assert fault in str(caught.value)
        assert caught.value.remedy
    with pytest.raises(UsageError):
        applicable(HANGER_3, ["beam1", name])


@pytest.mark.parametrize(("name", "key"), ADOPTABLE)
def test_every_effect_of_the_hanger_can_be_adopted_and_moves_a_frequency(
    name: str, key: str
) -> None:
    reference = ":reference_c=10" if "temperature" in EFFECTS[name].follows else ""
    model = build(f"beam1+{name}@{key}{reference}", HANGER_3)
    rng = np.random.default_rng(1)
    theta = rng.uniform(model.prior.lower, model.prior.upper, (5, len(model.bounds)))
    theta[:, 0] = 1.0
    test = ModalTest("t", (), temperature_c=30.0, amplitude=2.0)
    found = model.frequencies_at(theta, 4, model.conditions(test))
    assert found.shape == (5, 2, 4)
    bare = described("beam1", HANGER_3).frequencies_hz(np.array([[1.0, 1.0]]), 4)
    assert np.abs(found / bare - 1).max() > 1e-4


def test_a_known_mass_lowers_the_modes_that_move_it() -> None:
    test = ModalTest("t", modes_of(HANGER_3, 1.0), added_mass=AddedMass(25.0, 6.0))
    model = build(MASS, HANGER_3)
    model.refuse(test)
    loaded = model.frequencies_at(parameters(model), 3, model.conditions(test))
    free = model.frequencies_hz(parameters(model), 3)
    assert loaded[0, 0, 0] < 0.99 * free[0, 0, 0]
    np.testing.assert_allclose(loaded[0, 0, 1], free[0, 0, 1], rtol=1e-4)  # a node of order 2


def test_a_class_that_follows_the_temperature_refuses_a_test_without() -> None:
    with pytest.raises(BadInput, match="no temperature") as caught:
        build(WARMTH, HANGER_3).refuse(ModalTest("t", ()))
    assert caught.value.remedy


def test_priors_are_those_of_the_catalogue_and_of_the_scatter() -> None:
    bounds = build(MASS, HANGER_3).bounds
    mass = EFFECTS["point_mass"].parameters(HANGER_3, Variant())[0]
    as_made = build("beam1", HANGER_3).bounds
    assert {name: bounds[name] for name in as_made} == as_made
    uniform = build(MASS, HANGER_3, THESIS).bounds
    assert uniform["section"] == pytest.approx((-0.01 * 3**0.5, 0.01 * 3**0.5))
    assert [*uniform][-2:] == [*bounds][-2:] == ["log10_mass_kg", "x_m"]
    assert bounds["log10_mass_kg"][0] == pytest.approx(np.log10(mass.lower))
    assert bounds["x_m"] == (0.0, 12.0)
    signed = build("beam1+bending_stiffness@everywhere", HANGER_3).bounds["stiffness_change"]
    assert signed == (-0.8, 0.8)
    assert build(f"{MASS}:x_m=3..4", HANGER_3).bounds["x_m"] == (3.0, 4.0)


@pytest.mark.parametrize("priors", PRIORS)
@pytest.mark.parametrize("baseline", ["beam1", "beam2"])
def test_tension_and_springs_keep_the_names_and_the_ranges_of_their_class(
    baseline: str, priors: str
) -> None:
    """What reads a posterior's tension asks for theta_F, whatever its class has adopted."""
    bounds = build(f"{baseline}+point_mass@everywhere", HANGER_3, priors).bounds
    own = build(baseline, HANGER_3, priors).bounds
    shared = [name for name in own if name == "theta_F" or name.startswith("log10_k")]
    assert {name: bounds[name] for name in shared} == {name: own[name] for name in shared}


def test_class_of_a_posterior_has_its_parameters() -> None:
    """Posteriors of shm 1.0 have the deviations of an adopted class in uniform ranges."""
    model = build(MASS, HANGER_3)
    former = described(MASS, HANGER_3, THESIS)
    for each, names in ((model, model.parameter_names), (former, former.parameter_names)):
        posterior = quick_update.update(
            [ModalTest("t", modes_of(HANGER_3, 1.0), 3)], each, UpdateOptions(20)
        )
        assert posterior.names[:-1] == names
        found = class_of(replace(posterior, priors="description"), HANGER_3)
        assert found.parameter_names == names
        assert isinstance(found, AsMade) == (each is model)


def test_frequencies_of_a_former_class_are_those_of_its_bar() -> None:
    model = described(MASS, HANGER_3, THESIS)
    theta = parameters(model, log10_mass_kg=-6.0, length=0.002, section=0.01, modulus=0.02)
    unit = np.exp(0.5 * (2 * 0.01 + 0.02 - 0.01) - 2 * 0.002)
    tension = np.exp(2 * 0.002 - 2 * 0.01 - 0.02)
    bare = described("beam1", HANGER_3).frequencies_hz(np.array([[tension, 1.0]]), 5)
    np.testing.assert_allclose(model.frequencies_hz(theta, 5), unit * bare, rtol=1e-5)
