"""Coordinates in which every prior is standard normal."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shm.gap.contract import Hypothesis
from shm.gap.coordinates import Coordinates, cut
from shm.models.effects import Parameter
from tests.helpers.gap_campaigns import campaign, problem_of

INF, NAN = np.inf, np.nan
SIGNED = Parameter("change", "", 0.001, 0.1, 0.0, "", "logarithmic", signed=True)
MASS = Parameter("mass_kg", "kg", 0.01, 10.0, 0.0, "", "logarithmic")
SPRING = Parameter("log10_k", "N m/rad", 5.0, 9.0, INF, "")
PLACE = Parameter("x_m", "m", 0.0, 12.0, NAN, "")


def _coordinates(*effect: Parameter) -> Coordinates:
    return Coordinates(problem_of(campaign(tests=1)).described, effect)


def test_effect_values_follow_priors_and_back() -> None:
    """Normal draws of z follow the uniform and logarithmic priors (Kolmogorov-Smirnov)."""
    own = _coordinates(SIGNED, MASS, SPRING, PLACE)
    z = np.random.default_rng(1).standard_normal((2000, own.dimension))
    change, mass, _, place = own.effect_values(z).T
    for sample, exact in (
        (np.log10(mass), stats.uniform(-2, 3)),
        (np.log10(np.abs(change)), stats.uniform(-3, 2)),
        (place, stats.uniform(0, 12)),
    ):
        assert stats.kstest(sample, exact.cdf).pvalue > 1e-3
    assert abs((change > 0).mean() - 0.5) < 0.05
    z = z[:50].clip(-2.5, 2.5)
    found = own.effect_z(own.effect_values(z), own.baseline)
    np.testing.assert_allclose(found, z[:, own.baseline :], atol=1e-8)


def test_drawn_differs_in_the_unseen_alone() -> None:
    """Frequencies at rest of what is drawn are those at its middle."""
    problem = problem_of(campaign(tests=1))
    own = problem.coordinates(Hypothesis())
    z = 0.5 * np.random.default_rng(3).standard_normal((20, own.dimension))
    middle, drawn = own.theta(z), own.drawn(z, np.random.default_rng(4))
    assert (drawn != middle).any(axis=1).all()
    frequency = [problem.model.frequencies_hz(each, 4) for each in (middle, drawn)]
    np.testing.assert_allclose(frequency[1], frequency[0], rtol=2e-3)


@pytest.mark.parametrize(
    ("parameter", "lower", "upper"),
    [
        (MASS, 0.01 * 1000**0.25, 10.0),
        (SIGNED, 0.001 * 100**0.25, 0.1),
        (SPRING, 5.0, 8.0),
        (PLACE, 0.0, 12.0),
    ],
)
def test_cut_end_nearest_no_effect(parameter: Parameter, lower: float, upper: float) -> None:
    """Of sizes alone, and never all of one."""
    found = cut(parameter, 0.25)
    assert (found.lower, found.upper) == (pytest.approx(lower), pytest.approx(upper))
    assert cut(parameter, 1.0).lower < cut(parameter, 1.0).upper
