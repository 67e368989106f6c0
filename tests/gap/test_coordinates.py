"""Coordinates in which every prior is standard normal, and branches of signs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shm.gap.coordinates import Branch, Coordinates, cut
from shm.models.effects import Parameter
from shm.values import Scatter

INF, NAN = np.inf, np.nan
TENSION = Parameter("theta_F", "", 0.5, 5.0, NAN, "")
MADE = tuple(
    Parameter(n, "", -0.1, 0.1, 0.0, "") for n in ("section", "density", "length", "modulus")
)
SIGNED = Parameter("change", "", 0.001, 0.1, 0.0, "", "logarithmic", signed=True)
MASS = Parameter("mass_kg", "kg", 0.01, 10.0, 0.0, "", "logarithmic")
SPRING = Parameter("log10_k", "N m/rad", 5.0, 9.0, INF, "")
PLACE = Parameter("x_m", "m", 0.0, 12.0, NAN, "")


def _coordinates(*effect: Parameter) -> Coordinates:
    return Coordinates((TENSION, *MADE, *effect), 1, Scatter(0.01, 0.02, 0.03, 0.04))


def test_priors_of_z_are_those_declared() -> None:
    """Normal draws of z follow the uniform, logarithmic and normal priors (Kolmogorov-Smirnov)."""
    z = np.random.default_rng(1).standard_normal((2000, 7))
    theta = _coordinates(SIGNED, MASS).theta(z)
    for sample, exact in (
        (theta[:, 0], stats.uniform(0.5, 4.5)),
        (theta[:, 2], stats.norm(0, 0.02)),
        (np.log10(theta[:, 6]), stats.uniform(-2, 3)),
        (np.log10(np.abs(theta[:, 5])), stats.uniform(-3, 2)),
    ):
        assert stats.kstest(sample, exact.cdf).pvalue > 1e-3
    assert abs((theta[:, 5] > 0).mean() - 0.5) < 0.05


def test_parameters_and_coordinates_are_inverse() -> None:
    own = _coordinates(SIGNED, MASS, SPRING, PLACE)
    z = np.random.default_rng(2).standard_normal((50, own.dimension)).clip(-2.5, 2.5)
    np.testing.assert_allclose(own.z(own.theta(z)), z, atol=1e-8)


def test_tension_and_deviations_are_the_nearly_linear_ones() -> None:
    own = _coordinates(SIGNED, PLACE)
    assert own.linear.tolist() == [0, 1, 2, 3, 4]
    assert own.other.tolist() == [5, 6]


def test_there_is_a_branch_for_every_choice_of_signs_and_each_point_is_on_one() -> None:
    own = _coordinates(SIGNED, PLACE, SIGNED)
    z = np.random.default_rng(3).standard_normal((40, own.dimension))
    held = np.array([branch.holds(z) for branch in own.branches])
    assert len(held) == 4
    assert (held.sum(axis=0) == 1).all()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_branch_maps_magnitudes_onto_one_side_and_back(sign: float) -> None:
    branch = Branch(np.array([0.0, sign]))
    w = np.random.default_rng(4).standard_normal((100, 2))
    z = branch.z(w)
    assert (np.sign(z[:, 1]) == sign).all()
    np.testing.assert_allclose(branch.w(z), w, atol=1e-9)
    step = 1e-6
    slope = (branch.z(w[:1] + step) - branch.z(w[:1] - step)) / (2 * step)
    np.testing.assert_allclose(branch.stretch(w[0]), slope[0], rtol=1e-6)


def test_a_magnitude_has_a_normal_prior_on_its_branch() -> None:
    """w normal makes the logarithm of the magnitude uniform, as the prior has it."""
    w = np.random.default_rng(5).standard_normal((2000, 6))
    theta = _coordinates(SIGNED).theta(Branch(np.array([0, 0, 0, 0, 0, -1.0])).z(w))
    assert (theta[:, 5] < 0).all()
    assert stats.kstest(np.log10(-theta[:, 5]), stats.uniform(-3, 2).cdf).pvalue > 1e-3


@pytest.mark.parametrize(
    ("parameter", "lower", "upper"),
    [(MASS, 0.01 * 1000**0.25, 10.0), (SIGNED, 0.001 * 100**0.25, 0.1), (SPRING, 5.0, 8.0)],
)
def test_a_cut_takes_the_end_of_a_size_that_is_nearest_to_no_effect(
    parameter: Parameter, lower: float, upper: float
) -> None:
    found = cut(parameter, 0.25)
    assert found.lower == pytest.approx(lower)
    assert found.upper == pytest.approx(upper)


def test_only_sizes_are_cut_and_never_all_of_them() -> None:
    assert cut(PLACE, 0.5) is PLACE
    whole = cut(MASS, 1.0)
    assert whole.lower < whole.upper


def test_magnitudes_count_from_the_end_without_effect_and_sizes_grow_away_from_it() -> None:
    own = _coordinates(SIGNED, SPRING)
    theta = np.array([[1.0, 0, 0, 0, 0, -0.01, 9.0], [1.0, 0, 0, 0, 0, 0.001, 6.0]])
    np.testing.assert_allclose(own.magnitude(theta, 5), [0.5, 0.75])
    grown = own.grown(theta, 5, np.array([10.0, 10.0]))
    np.testing.assert_allclose(grown[:, 5:], [[-0.1, 8.0], [0.01, 5.0]])
