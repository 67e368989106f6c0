"""Causes that cannot be told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.causes.groups import expected_log_bayes_factor, group, views_from_peaks
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.inference.sampler.density import Peak
from shm.inference.sampler.likelihood import Covariance, Likelihood
from shm.values import FloatArray, IntArray
from tests.gap import linear_toy as toy


def test_expected_factor_half_square_beyond_what_follows() -> None:
    """A rigid rival of 4 standard deviations; one that follows is the same."""
    one, other = np.zeros(toy.design().size), np.zeros(toy.design().size)
    other[0] = 4 * toy.FREQUENCY_SD
    rigid = np.zeros((len(one), 1))
    found = expected_log_bayes_factor(toy.fit(one, rigid), toy.fit(other, rigid))
    assert found == pytest.approx(8.0)
    follows = toy.fit(toy.tension(0.001)[:, 0], toy.tension())
    assert expected_log_bayes_factor(toy.fit(one, toy.tension()), follows) < 0.01


SHIFTED = {k: toy.fit(toy.stiffening(k * 2e-3), toy.tension()) for k in (0, 1, 1.005, 2)}
STEPS = [toy.fit(toy.stiffening(k * 5e-5), 0 * toy.tension()) for k in range(3)]


@pytest.mark.parametrize(
    ("causes", "near", "groups"),
    [
        ([[SHIFTED[1]], [SHIFTED[0]], [SHIFTED[1.005]]], (), ((0, 2),)),
        ([[step] for step in STEPS], (), ((0, 1, 2),)),  # each alike to the next
        ([[SHIFTED[0], SHIFTED[1]], [SHIFTED[1]]], (), ((0, 1),)),  # by any view
        ([[SHIFTED[0]], [SHIFTED[1]], [SHIFTED[2]]], (), ()),
        ([[SHIFTED[0]], [SHIFTED[1]], [SHIFTED[2]]], (0, 2), ((0, 2),)),  # near by evidence
    ],
)
def test_group_alike(
    causes: list[list[Fit]], near: tuple[int, ...], groups: tuple[tuple[int, ...], ...]
) -> None:
    assert group(causes, [k in near for k in range(len(causes))]) == groups
    assert expected_log_bayes_factor(STEPS[0], STEPS[2]) > 3


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
