"""The straightened coordinates keep the prior: the same box, each point once, the whole mass."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest, norm

from shm.inference.coordinates import Coordinates
from shm.models import THESIS, build
from tests.helpers.hangers import HANGER_3

OWN = 3e6


@pytest.fixture(params=["beam1", "beam2"])
def coordinates(request) -> Coordinates:
    model = build(request.param, HANGER_3, THESIS)
    return Coordinates(model.prior, model.swaps, OWN)


@pytest.fixture
def theta(coordinates) -> np.ndarray:
    prior = coordinates.prior
    return np.random.default_rng(1).uniform(prior.lower, prior.upper, (4000, len(prior.names)))


def test_a_place_leads_back_to_its_parameters_or_their_exchanged_copy(coordinates, theta) -> None:
    back = coordinates.theta(coordinates.places(theta))
    np.testing.assert_allclose(back[:, :2], theta[:, :2], rtol=1e-7)
    for one, other in ((2, 4), (3, 5)) if theta.shape[1] == 6 else ():
        np.testing.assert_allclose(
            np.sort(back[:, [one, other]]), np.sort(theta[:, [one, other]]), rtol=1e-6
        )
        assert np.all(back[:, one] >= back[:, other] - 1e-9)


def test_the_density_has_the_whole_mass(coordinates) -> None:
    """The prior in z is that of theta: shares of any region agree with uniform draws."""
    rng = np.random.default_rng(2)
    prior = coordinates.prior
    d = len(prior.names)
    centre = coordinates.places(np.tile((prior.lower + prior.upper) / 2, (1, 1)))
    z = rng.normal(centre, 0.5, (200_000, d))
    weight = np.exp(coordinates.log_prior(z) - norm(centre, 0.5).logpdf(z).sum(axis=1))
    weight *= np.all(np.abs(z - centre) < 0.8, axis=1)
    drawn = coordinates.draw_prior(200_000, rng)
    share = np.all(np.abs(drawn - centre) < 0.8, axis=1).mean()
    error = np.hypot(weight.std(), np.sqrt(share)) / np.sqrt(200_000)
    assert weight.mean() == pytest.approx(share, abs=4 * error)
    assert error < 0.02 * share


def test_draws_of_the_prior_are_uniform_once_unfolded(coordinates) -> None:
    rng = np.random.default_rng(3)
    z = coordinates.draw_prior(4000, rng)
    assert np.isfinite(coordinates.log_prior(z)).all()
    theta = coordinates.unfold(coordinates.theta(z), rng)
    prior = coordinates.prior
    for share in ((theta - prior.lower) / (prior.upper - prior.lower)).T:
        assert kstest(share, "uniform").pvalue > 1e-4


def test_points_anywhere_fold_into_the_prior_and_stay_there(coordinates) -> None:
    z = np.random.default_rng(4).normal(0, 3, (4000, len(coordinates.prior.names)))
    folded = coordinates.fold(z)
    inside = np.isfinite(coordinates.log_prior(z))
    np.testing.assert_allclose(
        coordinates.theta(folded)[inside], coordinates.theta(z)[inside], rtol=1e-6
    )
    again = coordinates.fold(folded)
    np.testing.assert_allclose(coordinates.theta(again), coordinates.theta(folded), rtol=1e-6)


def test_pairs_that_give_as_much_lie_on_a_nearly_straight_line() -> None:
    model = build("beam2", HANGER_3, THESIS)
    coordinates = Coordinates(model.prior, model.swaps, OWN)
    stronger = np.linspace(7.0, 11.9, 50)
    weaker = np.log10(1 / (2 / (1e7 + OWN) - 1 / (10**stronger + OWN)) - OWN)
    theta = np.tile([1.0, 1.0, 0.0, 8.0, 0.0, 7.5], (50, 1))
    theta[:, 2], theta[:, 4] = stronger, weaker
    hooked = np.ptp(norm.ppf((weaker - 5) / 7))
    assert np.ptp(coordinates.places(theta)[:, 4]) < 0.12 * hooked


def test_frequencies_hardly_change_along_that_line() -> None:
    model = build("beam2", HANGER_3, THESIS)
    own = model.wave_stiffness_n_m_rad(3.5)
    coordinates = Coordinates(model.prior, model.swaps, own)
    start = coordinates.places(np.array([[1.0, 1.0, 7.2, 8.0, 7.2, 7.5]]))
    along = np.repeat(start, 30, axis=0)
    along[:, 2] = np.linspace(start[0, 2], 2.5, 30)
    across = np.repeat(start, 30, axis=0)
    across[:, 4] = start[0, 4] - (along[:, 2] - start[0, 2])
    moved, softened = (
        np.ptp(model.frequencies_hz(coordinates.theta(z), 6)[:, 0], axis=0) for z in (along, across)
    )
    assert np.all(moved < 0.2 * softened)
