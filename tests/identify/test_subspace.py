from __future__ import annotations

import numpy as np
import pytest

from shm.identify.estimation.hankel import hankel
from shm.identify.estimation.pyoma import poles_of_orders
from shm.identify.estimation.shapes import collinearity, real_shape

RATE_HZ = 256.0


def _decay(frequency_hz: float = 20.0, damping_ratio: float = 0.004) -> np.ndarray:
    omega = 2 * np.pi * frequency_hz
    pole = -damping_ratio * omega + 1j * omega * np.sqrt(1 - damping_ratio**2)
    motion = np.exp(pole * np.arange(1500) / RATE_HZ)
    return np.vstack([motion.real, 0.4 * motion.real, -0.7 * motion.real])


def test_the_hankel_matrix_of_one_decay_has_rank_two() -> None:
    decay = _decay()
    matrix = hankel(decay, decay[:1], 30)
    assert matrix.shape == (90, 30)
    assert np.linalg.matrix_rank(matrix, tol=1e-8 * np.linalg.norm(matrix)) == 2


def test_it_is_the_sum_of_products_of_what_comes_and_what_was() -> None:
    rng = np.random.default_rng(1)
    response, rows = rng.normal(size=(3, 90)), 8
    coming = np.vstack([response[:, rows + i : 90 - rows + 1 + i] for i in range(rows)])
    past = np.vstack([response[:2, rows - 1 - j : 90 - rows - j] for j in range(rows)])
    expected = coming @ past.T * 90 / (90 - 2 * rows + 1)
    np.testing.assert_allclose(hankel(response, response[:2], rows), expected, atol=1e-11)


def test_it_is_a_sum_over_time_so_that_long_decays_weigh_more() -> None:
    decay = np.ones((1, 200))
    assert hankel(decay, decay, 5) == pytest.approx(200 * np.ones((5, 5)))


def test_a_realisation_returns_the_pole_and_the_shape_that_made_the_decay() -> None:
    decay = _decay(20.0, 0.004)
    (poles,) = poles_of_orders(hankel(decay, decay, 30), 30, [2], RATE_HZ)
    assert poles.frequency_hz == pytest.approx([20.0], rel=1e-9)
    assert poles.damping_ratio == pytest.approx([0.004], rel=1e-6)
    np.testing.assert_allclose(real_shape(poles.shapes[:, 0]), [1.0, 0.4, -0.7], atol=1e-9)


def test_a_shape_is_collinear_where_all_its_phases_agree() -> None:
    shape = np.array([1.0, -0.5, 0.2])
    assert collinearity(shape * np.exp(0.7j)) == pytest.approx(1.0)
    assert collinearity(np.array([1.0, 1.0j])) == pytest.approx(0.0, abs=1e-12)
    assert collinearity(np.zeros(2, complex)) == 0.0


def test_a_real_shape_does_not_depend_on_the_phase_it_came_with() -> None:
    shape = np.array([0.3, -1.2, 0.6])
    for phase in np.linspace(0, 6, 7):
        np.testing.assert_allclose(real_shape(shape * np.exp(1j * phase)), shape / -1.2, atol=1e-12)
