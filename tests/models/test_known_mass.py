"""A known mass that turns with the bar, against a beam of elements with its rotary inertia."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy

from shm.assumptions import DEFAULTS
from shm.models import MODELS, THESIS, AsMade, build
from shm.models.classes.base import Conditions
from shm.models.hanger import PhysicalHanger, solve
from shm.simulate.effects import plant_effects
from shm.values import AddedMass, FloatArray, Hanger

ROD = Hanger(58, 3.5, 210e9, 7.069e-4, 3.976e-8, 5.549, 47.2e3)
PLACE_M, MODES = 1.05, 6
HEAVY = 5.0
USUAL_M = DEFAULTS.added_mass_radius_m.value


def by_elements(hanger: Hanger, mass: AddedMass, elements: int = 120) -> FloatArray:
    """Return frequencies (modes,) of a clamped bar, with the mass and its m r^2 at a node."""
    size = 2 * (elements + 1)
    stiffness, inertia = np.zeros((size, size)), np.zeros((size, size))
    h = hanger.length_m / elements
    bending = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    taut = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]])
    moved = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    in_m = np.outer([1, h, 1, h], [1, h, 1, h])
    k = in_m * hanger.bending_stiffness_n_m2 * bending / h**3
    k += in_m * hanger.nominal_tension_n * taut / (30 * h)
    m = in_m * hanger.mass_per_length_kg_m * h * moved / 420
    for first in range(0, size - 2, 2):
        stiffness[first : first + 4, first : first + 4] += k
        inertia[first : first + 4, first : first + 4] += m
    node = round(mass.x_m / h)
    assert node * h == pytest.approx(mass.x_m)
    inertia[2 * node, 2 * node] += mass.mass_kg
    inertia[2 * node + 1, 2 * node + 1] += mass.mass_kg * (mass.radius_of_gyration_m or 0.0) ** 2
    free = slice(2, -2)
    square = scipy.linalg.eigh(stiffness[free, free], inertia[free, free], eigvals_only=True)
    return np.asarray(np.sqrt(square[:MODES]) / (2 * np.pi))


def general(mass: AddedMass) -> FloatArray:
    """Solve the general model, as the diagnosis has it but for the terms."""
    model = AsMade(MODELS["beam1"](ROD), with_terms=False)
    theta = np.array([[1.0, 1.0, 0.0, 0.0, 0.0]])
    hanger = model.with_effects(())
    return hanger.modes(theta, Conditions(added_mass=mass), MODES, False).frequency_hz[0, 0]


def planted(mass: AddedMass) -> FloatArray:
    """Solve the general model, as the simulator has it."""
    bare = PhysicalHanger.clamped(ROD, np.array([ROD.nominal_tension_n]))
    bar = plant_effects(bare, (), Conditions(added_mass=mass), ROD, ())
    return solve(bar, MODES, np.empty(0), shapes=False).frequency_hz[0, 0]


def beam(mass: AddedMass) -> FloatArray:
    """Solve a class by its closed form, laden by the general model."""
    theta = np.array([[1.0, 1.0]])
    model = build("beam1", ROD, THESIS)
    return model.frequencies_at(theta, MODES, Conditions(added_mass=mass))[0, 0]


def as_made(mass: AddedMass) -> FloatArray:
    """Solve a class with the terms of a bar that stands upright, whose weight matters little."""
    model = build("beam1", ROD)
    known = {"theta_F": 1.0, "theta_L": 1.0, "inclination": 90.0}
    theta = model.pack({name: known.get(name, 0.0) for name in model.parameter_names})[None]
    return model.frequencies_at(theta, MODES, Conditions(added_mass=mass))[0, 0]


@pytest.mark.parametrize("predict", [general, planted, beam, as_made])
@pytest.mark.parametrize("radius_m", [0.0, 0.05, 0.2])
def test_a_known_mass_turns_as_its_rotary_inertia_does(
    predict: Callable[[AddedMass], FloatArray], radius_m: float
) -> None:
    """Agree within 1e-5, where turning takes up to 1 % (0.05 m); the weight takes 1e-4."""
    expected = by_elements(ROD, AddedMass(HEAVY, PLACE_M, radius_m))
    found = predict(AddedMass(HEAVY, PLACE_M, radius_m))
    np.testing.assert_allclose(found, expected, rtol=2e-4 if predict is as_made else 1e-5)
    point = by_elements(ROD, AddedMass(HEAVY, PLACE_M, 0.0))
    assert radius_m == 0 or np.abs(expected / point - 1).max() > 0.01


@pytest.mark.parametrize("predict", [general, beam, as_made])
def test_an_unstated_radius_is_the_usual_one_in_a_prediction(
    predict: Callable[[AddedMass], FloatArray],
) -> None:
    found = predict(AddedMass(HEAVY, PLACE_M))
    np.testing.assert_allclose(found, predict(AddedMass(HEAVY, PLACE_M, USUAL_M)), rtol=1e-9)


def test_what_is_planted_without_a_radius_is_a_point() -> None:
    found, point = (planted(AddedMass(HEAVY, PLACE_M, *radius)) for radius in ((), (0.0,)))
    np.testing.assert_allclose(found, point, rtol=1e-12)
