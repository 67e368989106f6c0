"""Beams with turnbuckles against the plain one, a closed form and elements of another make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.models import PRIORS, THESIS, build
from shm.simulate import HangerState
from shm.values import PLANES, Hanger, Turnbuckle
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.elements import natural_frequencies, plane_modes

LOW = Turnbuckle(x_m=1.5, length_m=0.6, mass_kg=150.0, bending_stiffness_n_m2=1e7)
HIGH = Turnbuckle(x_m=9.0, length_m=0.4, mass_kg=60.0, bending_stiffness_n_m2=3e7)
MIDDLE = Turnbuckle(x_m=6.0, length_m=0.5, mass_kg=400.0, bending_stiffness_n_m2=5e7)


def with_turnbuckles(*turnbuckles: Turnbuckle, **changes: float) -> Hanger:
    return replace(HANGER_3, plate=None, turnbuckles=turnbuckles, **changes)


@pytest.mark.parametrize(
    "turnbuckles", [(LOW,), (MIDDLE,), (LOW, HIGH), (replace(LOW, x_m=0.3), HIGH)]
)
@pytest.mark.parametrize(
    "theta", [(1, 1, 7, 6, 9, 8), (4, 0.7, 6, 7, 8, 12), (0.5, 1.4, 8, 5, 5, 8)]
)
def test_frequencies_and_shapes_are_those_of_hermite_elements(turnbuckles, theta) -> None:
    hanger = with_turnbuckles(*turnbuckles)
    model, parameters = build("beam2", hanger, THESIS), np.array(theta, dtype=float)
    stiffness = 10 ** parameters[2:]
    state = HangerState(711e3 * theta[0], *stiffness, length_m=12 * theta[1])
    exact, elements = (
        model.frequencies_hz(parameters[None], 8)[0],
        natural_frequencies(hanger, state, 8),
    )
    np.testing.assert_allclose(exact, elements, rtol=3e-5)
    x = np.linspace(0, state.length_m, 401)
    for plane in PLANES:
        of_elements = plane_modes(hanger, state, plane, 6).at(x)
        for order in range(1, 7):
            shape, other = model.shape(parameters, plane, order, x), of_elements[:, order - 1]
            np.testing.assert_allclose(shape, other * (shape @ other) / (other @ other), atol=5e-3)


def test_the_effective_length_is_taken_up_by_the_bar_between_the_turnbuckles() -> None:
    """9 m of a 12 m hanger with 1 m of turnbuckles: 8/11 of every piece of bar is left."""
    hanger = with_turnbuckles(LOW, HIGH)
    left = 8 / 11
    low = replace(LOW, x_m=left * 1.2 + 0.3)
    high = replace(HIGH, x_m=left * (1.2 + 7.0) + 0.6 + 0.2)
    shorter = with_turnbuckles(low, high, length_m=9.0)
    np.testing.assert_allclose(
        build("beam1", hanger, THESIS).frequencies_hz(np.array([[1.0, 0.75]]), 6),
        build("beam1", shorter, THESIS).frequencies_hz(np.array([[1.0, 1.0]]), 6),
        rtol=1e-9,
    )


def test_the_ends_can_be_exchanged_only_where_the_turnbuckles_lie_alike_from_both() -> None:
    theta = np.array([[1.0, 1.0, 6.5, 6, 8, 9]])
    swapped = theta[:, [0, 1, 4, 5, 2, 3]]
    middle, low = (
        build("beam2", with_turnbuckles(MIDDLE), THESIS),
        build("beam2", with_turnbuckles(LOW), THESIS),
    )
    np.testing.assert_allclose(
        middle.frequencies_hz(swapped, 6), middle.frequencies_hz(theta, 6), rtol=1e-10
    )
    assert middle.swaps == build("beam2", HANGER_3, THESIS).swaps != ()
    assert np.abs(low.frequencies_hz(swapped, 6) / low.frequencies_hz(theta, 6) - 1).max() > 1e-3
    assert low.swaps == ()


def test_an_effective_length_without_room_for_the_turnbuckles_is_refused() -> None:
    with pytest.raises(UsageError, match=r"0\.6 m long together"):
        build("beam1", with_turnbuckles(LOW), THESIS).frequencies_hz(np.array([[1.0, 0.04]]), 3)


@pytest.mark.parametrize("priors", PRIORS)
def test_a_slender_bar_with_turnbuckles_is_the_same_with_shear(priors: str) -> None:
    """A bar of 12 m and 25 mm: shear takes less than 1e-3 of the sixth frequency."""
    thin = replace(HANGER_3, plate=None, area_m2=4.9e-4, second_moment_m4=1.9e-8)
    thin = replace(thin, mass_per_length_kg_m=3.85, nominal_tension_n=60e3)
    coupler = Turnbuckle(x_m=1.5, length_m=0.4, mass_kg=6.0, bending_stiffness_n_m2=3e4)
    known = dict.fromkeys(("log10_k1", "log10_k2", "log10_k3", "log10_k4"), 4.0)
    known |= {"theta_F": 1.1, "theta_L": 1.0, "inclination": 90.0}
    known |= {"turnbuckle_stiffness": 1.2, "turnbuckle_mass": 0.9}
    found = []
    for name in ("beam2", "beam3"):
        model = build(name, replace(thin, turnbuckles=(coupler,)), priors)
        theta = model.pack({each: known.get(each, 0.0) for each in model.parameter_names})
        found.append(model.frequencies_hz(theta[None], 6))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3)
    assert np.abs(found[1] / found[0] - 1).max() > 1e-6
