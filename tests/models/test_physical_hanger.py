"""Compare the general hanger model of a class as made with the class itself and with elements."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.models import AsMade, described
from shm.models.classes.base import Conditions, radius_m
from shm.models.hanger import PhysicalHanger, PointMass, physical, solve
from shm.values import AddedMass, FloatArray, Hanger, Supports, Turnbuckle
from tests.helpers.classes_as_made import as_made, drawn
from tests.helpers.hangers import HANGER_3
from tests.worlds.eight_kinds import Member, Zone, natural_frequencies_hz

ROD = Hanger(1, 9.0, 205e9, 2.827e-3, 6.36e-7, 22.2, 180e3)
TUBE = replace(
    ROD,
    area_m2=1.635e-3,
    second_moment_m4=1.402e-6,
    mass_per_length_kg_m=12.83,
    fittings_m=(0.4, 0.25),
    ends="fork",
    turnbuckles=(Turnbuckle(3.1, 0.5, 21.0, 9e5), Turnbuckle(6.5, 0.4, 12.0, 4e5)),
)
STRAND = Hanger(
    2, 24.0, 165e9, 8e-4, 1.2e-7, 6.6, 200e3, kind="strand", bending_stiffness_factor=0.5,
    fittings_m=(0.5, 0.6),
)  # fmt: skip
SLACK = replace(ROD, inclination_deg=35.0, nominal_tension_n=20e3)
HANGERS = {"rod": ROD, "tube": TUBE, "strand": STRAND, "plates": HANGER_3, "slack": SLACK}
MODES, SETS = 7, 12
REDUCED = 1.5e-4  # of a frequency, by the reduced basis
NOWHERE = np.empty(0)


def stiff_zone(start_m: float, end_m: float) -> physical.Zone:
    one = np.ones(1)
    return physical.Zone(start_m * one, end_m * one, 6 * one, one)


def solved(bar: PhysicalHanger) -> FloatArray:
    return solve(bar, MODES, NOWHERE, shapes=False).frequency_hz


@pytest.mark.parametrize("name", ["beam1", "beam2", "beam3"])
@pytest.mark.parametrize("kind", HANGERS)
def test_physical_frequencies_are_the_class_own(kind: str, name: str) -> None:
    """Of the bar, of the class with no effects, and where it has shapes those as well."""
    model = as_made(name, HANGERS[kind])
    theta, places = drawn(model, SETS), np.array([0.1, 0.3, 0.5, 0.75]) * HANGERS[kind].length_m
    bar, bare = model.physical(theta), model.with_effects([], tuple(places))
    own_hz = model.frequencies_hz(theta, MODES)
    np.testing.assert_allclose(solved(bar), own_hz, rtol=REDUCED)
    assert bare.parameter_names == model.parameter_names
    found = bare.modes(theta, Conditions("t1"), MODES)
    np.testing.assert_allclose(found.frequency_hz, own_hz, rtol=2e-4)
    if not model.length_is_open and kind != "slack":
        shapes = model.shapes(theta, 3, places)
        for plane in (0, 1):
            seen = found.shape[:, plane, :3, :, plane]
            likeness = np.einsum("nmx,nmx->nm", seen, shapes[:, plane])
            sizes = np.linalg.norm(seen, axis=2) * np.linalg.norm(shapes[:, plane], axis=2)
            np.testing.assert_allclose(np.abs(likeness / sizes), 1, atol=1e-5)
    if kind == "slack":
        straight = replace(bar, sag_parameter=0 * bar.sag_parameter)
        assert np.abs(solved(straight) / solved(bar) - 1).max() > 0.02


@pytest.mark.parametrize("kind", ["rod", "tube"])
def test_physical_with_known_mass(kind: str) -> None:
    hanger = HANGERS[kind]
    mass = AddedMass(x_m=2.2, mass_kg=9.0)
    model = as_made("beam2", hanger)
    theta = drawn(model, SETS)
    # The class lets it keep its part of the length.
    length, one = model.stiffness_mass_length(theta)[2], np.ones(SETS)
    clamped_on = PointMass(2.2 * length, 9.0 * one, radius_m(hanger, mass) * length)
    bar = replace(model.physical(theta), masses=(clamped_on,))
    found = model.frequencies_at(theta, MODES, Conditions(added_mass=mass))
    np.testing.assert_allclose(solved(bar), found, rtol=REDUCED)


def test_physical_on_supports() -> None:
    hanger = replace(ROD, supports=Supports("free", "pinned"), nominal_tension_n=0.0)
    model = described("beam1", hanger, "description")
    assert isinstance(model, AsMade)
    values = dict.fromkeys(model.parameter_names, 0.0)
    values |= {"theta_F": 1.0, "theta_L": 1.02, "section": 0.03, "density": 0.01, "modulus": 0.02}
    stiffness, mass = math.exp(2 * 0.03 + 0.02), math.exp(0.03 + 0.01)
    unit = math.sqrt(stiffness * hanger.bending_stiffness_n_m2 / mass / 22.2)
    unit /= (1.02 * hanger.length_m) ** 2
    # tan x = tanh x, of a free and pinned bar (Blevins 1979, table 8-1)
    roots = np.array([3.92660231, 7.06858275, 10.21017612])
    found = solved(model.physical(model.pack(values)[None]))[0, 0, :3]
    np.testing.assert_allclose(found, unit * roots**2 / (2 * np.pi), rtol=1e-6)


def test_physical_with_open_length_is_centred() -> None:
    model = as_made("beam2", HANGER_3)
    bar = model.physical(drawn(model, SETS))
    np.testing.assert_allclose(bar.deck_end_m + bar.arch_end_m, 12.0)
    assert bar.length_m.min() < 11.0


@pytest.mark.parametrize("tension_n", [9e3, 40e3])
@pytest.mark.parametrize("shears", [False, True])
@pytest.mark.parametrize("at_deck", [True, False])
def test_tension_gradient_against_elements(at_deck: bool, shears: bool, tension_n: float) -> None:
    """Lay a zone at one end, so that a gradient the wrong way round would be seen."""
    one, length, weight_n = np.ones(1), ROD.length_m, 16e3
    zone = (0.0, 1.5) if at_deck else (length - 1.5, length)
    made = PhysicalHanger.clamped(ROD, tension_n * one)
    bar = replace(
        made,
        tension_gradient_n=weight_n * one,
        rotational_compliance_rad_n_m=np.full((1, 2, 1, 1), 1 / 5e5) * np.eye(2),
        shear_compliance_1_n=shears / ROD.shear_stiffness_n * one,
        zones=(stiff_zone(*zone),),
    )
    member = Member(
        length,
        tension_n,
        ROD.bending_stiffness_n_m2,
        ROD.mass_per_length_kg_m,
        ROD.shear_stiffness_n if shears else math.inf,
        zones=(Zone(*zone, 6.0, 1.0),),
        rotation_n_m_rad=(5e5, 5e5),
        gravity_along_m_s2=weight_n / length / ROD.mass_per_length_kg_m,
    )
    expected = natural_frequencies_hz(member, MODES)
    np.testing.assert_allclose(solved(bar)[0, 0], expected, rtol=3e-5)
    turned = solved(replace(bar, tension_gradient_n=-weight_n * one))[0, 0]
    assert np.abs(turned / expected - 1).max() > 1e-3
