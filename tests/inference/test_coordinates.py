"""Hold the sampler's coordinates against the prior of the thesis."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from shm.inference.coordinates import Coordinates
from shm.models import THESIS, build
from tests.helpers.hangers import HANGER_3


@pytest.fixture(params=["beam1", "beam2"])
def coordinates(request) -> Coordinates:
    model = build(request.param, HANGER_3, THESIS)
    return Coordinates(model.prior, model.swaps, 3e6)


def test_the_folded_density_is_that_of_the_draws(coordinates: Coordinates) -> None:
    """Compare the density's integral over a region with the fraction of draws within it."""
    rng, d = np.random.default_rng(2), coordinates.dimension
    z = 0.5 * rng.standard_normal((100_000, d))
    weight = np.exp(coordinates.log_prior(z) - norm(0, 0.5).logpdf(z).sum(axis=1))
    weight *= np.all(np.abs(z) < 0.8, axis=1)
    drawn = coordinates.draw_prior(100_000, rng)
    fraction = np.all(np.abs(drawn) < 0.8, axis=1).mean()
    error = np.hypot(weight.std(), np.sqrt(fraction)) / np.sqrt(100_000)
    assert weight.mean() == pytest.approx(fraction, abs=4 * error)


def test_a_pair_is_unfolded_where_its_posterior_reaches_the_fold() -> None:
    model, rng = build("beam2", HANGER_3, THESIS), np.random.default_rng(4)
    coordinates = Coordinates(model.prior, model.swaps, 3e6)
    z = coordinates.fold(0.1 * rng.standard_normal((500, 6)))
    z[:, 2] += 3  # one pair far from the fold, the other on it
    connected = coordinates.connect(z, rng)
    assert (connected[:, 3] < connected[:, 5]).mean() == pytest.approx(0.5, abs=0.1)
    assert np.isfinite(coordinates.log_prior(connected)).all()
    connected[:, [2, 4]] = connected[:, [4, 2]]
    assert np.isinf(coordinates.log_prior(connected)).all()
    inside = coordinates.draw_prior(50_000, rng)
    assert np.isfinite(coordinates.log_prior(inside)).all()
