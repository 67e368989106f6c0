"""Tensioned bars in springs against closed forms and against the simulator's elements."""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify.mode_ordering.bars import any_bars, log_factor, shapes_of, solved
from shm.simulate import HangerState
from shm.values import FloatArray, Hanger
from tests.worlds.simulated.elements import natural_frequencies

ORDERS = np.arange(1, 9)


def _ratios(xi: float, fixity: float) -> FloatArray:
    logs = log_factor(float(np.log(xi)), np.full(len(ORDERS), fixity), ORDERS.astype(float))
    return np.asarray(np.exp(logs - logs[0]))


def test_without_tension_and_rigid_ends_it_is_the_clamped_beam() -> None:
    """beta L = 4.7300, 7.8532, 10.9956, 14.1372 (roots of cos cosh = 1)."""
    beta = solved(np.zeros(4), np.ones(4), ORDERS[:4])[0]
    np.testing.assert_allclose(beta[1:], [7.8532, 10.9956, 14.1372], rtol=2e-4)
    assert beta[0] == pytest.approx(4.7300, rel=0.005)


def test_under_large_tension_it_is_a_string() -> None:
    """f_n = n f_1, clamped or not."""
    for fixity in (0.0, 1.0):
        np.testing.assert_allclose(_ratios(1000.0, fixity), ORDERS, rtol=5e-4)


@pytest.mark.parametrize("xi", [1.0, 7.0, 60.0])
def test_a_pinned_tensioned_beam_has_its_closed_form(xi: float) -> None:
    """f_n ~ n sqrt(xi^2 + (n pi)^2)."""
    expected = ORDERS * np.sqrt(xi**2 + (ORDERS * np.pi) ** 2)
    np.testing.assert_allclose(_ratios(xi, 0.0), expected / expected[0], rtol=1e-9)


@pytest.mark.parametrize("spring_n_m_rad", [0.0, 1e6, np.inf])
def test_some_bar_of_the_grid_fits_a_hanger_by_finite_elements(spring_n_m_rad: float) -> None:
    """The grid is coarse, a yardstick: every order within 1.5 %."""
    hanger = Hanger(1, 12.0, 200e9, 0.0133, 1.4e-5, 103.5, 711e3)
    state = HangerState(711e3, *(4 * (spring_n_m_rad,)))
    logs = np.log(natural_frequencies(hanger, state, 8)[0])
    difference = logs - any_bars(5.0).log_factor[..., :8]
    misfit = np.abs(difference - difference.mean(axis=-1, keepdims=True)).max(axis=-1)
    assert misfit.min() < 0.015


def test_shapes_vanish_at_both_ends_and_have_one_more_node_each_order() -> None:
    position = np.linspace(0, 1, 401)
    xi = np.geomspace(8.0, 300.0, 20)[:, np.newaxis, np.newaxis]
    stiff = shapes_of(solved(xi, np.linspace(0, 1, 5)[:, np.newaxis], ORDERS[:6]), position)
    assert np.abs(stiff[..., [0, -1]]).max() < 0.01 * np.abs(stiff).max()
    inner = stiff[..., 20:-20]
    nodes = np.sum(np.diff(np.sign(inner), axis=-1) != 0, axis=-1)
    assert np.all(nodes == np.arange(6))
