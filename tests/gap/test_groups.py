"""Causes that cannot be told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Fit, Hypothesis
from shm.gap.groups import expected_log_bayes_factor, group, views_from_peaks
from shm.inference.likelihood import Covariance, Likelihood
from shm.inference.posterior import Peak
from shm.values import FloatArray, IntArray
from tests.gap import linear_toy as toy


def far(causes: list[list[Fit]]) -> tuple[tuple[int, ...], ...]:
    """Group causes of which none is near the best by evidence."""
    return group(causes, [False] * len(causes))


def test_expected_factor_rigid_half_square() -> None:
    one, other = np.zeros(toy.design().size), np.zeros(toy.design().size)
    other[0] = 4 * toy.FREQUENCY_SD
    rigid = np.zeros((len(one), 1))
    found = expected_log_bayes_factor(toy.fit(one, rigid), toy.fit(other, rigid))
    assert found == pytest.approx(8.0)


def test_expected_factor_rival_follows() -> None:
    near, far = toy.fit(np.zeros(toy.design().size), toy.tension()), toy.tension(0.001)[:, 0]
    assert expected_log_bayes_factor(near, toy.fit(far, toy.tension())) < 0.01


def test_group_alike() -> None:
    alike = [toy.fit(toy.stiffening(size), toy.tension()) for size in (2e-3, 2.01e-3)]
    apart = toy.fit(np.zeros(toy.design().size), toy.tension())
    assert far([[alike[0]], [apart], [alike[1]]]) == ((0, 2),)


def test_group_connected() -> None:
    steps = [toy.fit(toy.stiffening(k * 5e-5), np.zeros((toy.design().size, 1))) for k in range(3)]
    assert expected_log_bayes_factor(steps[0], steps[2]) > 3
    assert far([[step] for step in steps]) == ((0, 1, 2),)


def test_group_any_view() -> None:
    one, other = (toy.fit(toy.stiffening(size), toy.tension()) for size in (0.0, 2e-3))
    assert far([[one, other], [toy.fit(toy.stiffening(2e-3), toy.tension())]]) == ((0, 1),)


def test_group_near_by_evidence() -> None:
    causes = [[toy.fit(toy.stiffening(size), toy.tension())] for size in (0.0, 2e-3, 4e-3)]
    assert far(causes) == ()
    assert group(causes, [True, False, True]) == ((0, 2),)


class Mirrored:
    """A problem whose prediction is the square of its one parameter."""

    value = np.zeros(3)

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        return np.asarray(z**2 * np.arange(1.0, 4.0))

    def dimension(self, hypothesis: Hypothesis) -> int:
        return 1

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        return np.zeros(0, dtype=np.int64)

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        errors = Covariance(np.eye(3), np.zeros(0), np.zeros((0, 0)))
        return Likelihood.of(errors, 0.0)


def test_views_from_notable_peaks() -> None:
    """A peak with a tenth of the best one's evidence gives no view."""
    peaks = [
        Peak(np.array([at]), log, np.eye(1)) for at, log in ((1.0, 0.0), (-2.0, -1.0), (3.0, -2.3))
    ]
    fit = replace(toy.fit(np.zeros(3), np.zeros((3, 1))), peaks=tuple(peaks))
    first, other = views_from_peaks(Mirrored(), fit)
    assert first is fit
    np.testing.assert_allclose(other.predicted, [4.0, 8.0, 12.0])
    np.testing.assert_allclose(other.slopes[:, 0], [-4.0, -8.0, -12.0], rtol=1e-3)
