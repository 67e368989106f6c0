"""Hold the proposal along a bent valley against integrals that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from shm.inference.sampler.valley import Proposal, valleys_through
from shm.values import FloatArray

SD = 0.01
WHITENING = np.array([[1 / SD]])


def bend(z: FloatArray) -> FloatArray:
    """Return z with the first coordinate less a parabola of the second: a volume-preserving map."""
    bent = z.copy()
    bent[:, 0] -= 0.7 * z[:, 1] ** 2
    return bent


class BentProblem:
    """Give one datum, z0 - 0.7 z1^2 = 0 to 0.01, of four standard normal coordinates."""

    dimension = 4

    @staticmethod
    def residual(z: FloatArray) -> FloatArray:
        return -bend(z)[:, :1]

    @staticmethod
    def slopes(z: FloatArray, directions: FloatArray | None = None) -> FloatArray:
        rows = np.zeros((len(z), 1, 4))
        rows[:, 0, 0], rows[:, 0, 1] = 1.0, -1.4 * z[:, 1]
        return rows if directions is None else rows @ directions

    def look(
        self, z: FloatArray, directions: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        return self.residual(z), self.slopes(z, directions)

    @staticmethod
    def predict(z: FloatArray) -> FloatArray:
        return bend(z)[:, :1]


def points_along(n: int, rng: np.random.Generator) -> FloatArray:
    """Return points (n, 4) on the bottom of the valley."""
    z = 0.7 * rng.standard_normal((n, 4))
    z[:, 0] = 0.7 * z[:, 1] ** 2
    return z


@pytest.fixture(scope="module")
def proposal() -> Proposal:
    rng = np.random.default_rng(1)
    points = points_along(160, rng)
    valleys = valleys_through(BentProblem(), points, np.zeros(160, int), WHITENING)  # type: ignore[arg-type]
    assert len(valleys) == 1
    return Proposal.through(valleys, points, 4, rng)


def test_a_normal_target_in_the_bent_valley_integrates_to_one(proposal: Proposal) -> None:
    """Integrate a density over the valley, and the prior times the likelihood."""
    rng = np.random.default_rng(2)
    draws = proposal.draw(BentProblem(), 20_000, rng)  # type: ignore[arg-type]
    bent = bend(draws.z)
    target = norm(0, SD).logpdf(bent[:, 0]) + norm(0, 1).logpdf(bent[:, 1:]).sum(axis=1)
    weight = np.exp(target - proposal.log_density(draws))
    assert weight.mean() == pytest.approx(1, abs=5 * weight.std() / np.sqrt(len(weight)))
    assert weight.std() < 2
    mean = weight / weight.sum() @ draws.z
    assert mean[0] == pytest.approx(0.7, abs=0.05)
    np.testing.assert_allclose(mean[1:], 0, atol=0.05)
    # Prior times likelihood: z0 ~ N(0, 1) meets 0.7 z1^2 in one integral.
    z1 = np.linspace(-8, 8, 4001)
    evidence = np.trapezoid(norm.pdf(z1) * norm(0, np.hypot(1, SD)).pdf(0.7 * z1**2), z1)
    log = norm(0, SD).logpdf(bent[:, 0]) + norm.logpdf(draws.z).sum(axis=1)
    found = np.exp(log - proposal.log_density(draws)).mean()
    assert np.log(found) == pytest.approx(np.log(evidence), abs=0.03)
