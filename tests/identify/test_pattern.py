"""The pattern of a tensioned beam against closed forms and against the simulator's elements."""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify.mode_ordering.alignment import HIGHEST_ORDER, Pattern, tensioned_beam_pattern
from shm.simulate import HangerState
from shm.values import FloatArray, Hanger
from tests.worlds.simulated.elements import natural_frequencies

ORDERS = np.arange(1, 9)


def _ratios(pattern: Pattern, tension: int, spring: int) -> FloatArray:
    logs = pattern.log_frequency[tension, spring, : len(ORDERS)]
    return np.asarray(np.exp(logs - logs[0]))


def test_without_tension_and_springs_it_is_the_pinned_beam() -> None:
    """f_n = n^2 f_1."""
    np.testing.assert_allclose(_ratios(tensioned_beam_pattern(), 0, 0), ORDERS**2, rtol=1e-9)


def test_without_tension_and_rigid_ends_it_is_the_clamped_beam() -> None:
    """beta L = 4.7300, 7.8532, 10.9956, 14.1372 (roots of cos cosh = 1)."""
    beta = tensioned_beam_pattern().beta[0, -1, :4]
    np.testing.assert_allclose(beta[1:], [7.8532, 10.9956, 14.1372], rtol=2e-4)
    assert beta[0] == pytest.approx(4.7300, rel=0.005)


def test_under_large_tension_it_is_a_string() -> None:
    """f_n = n f_1, clamped or not."""
    pattern = tensioned_beam_pattern()
    for spring in (0, -1):
        np.testing.assert_allclose(_ratios(pattern, -1, spring), ORDERS, rtol=5e-4)


def test_a_pinned_tensioned_beam_has_its_closed_form() -> None:
    """f_n ~ n sqrt(xi^2 + (n pi)^2)."""
    pattern = tensioned_beam_pattern()
    for tension in range(pattern.beta.shape[0]):
        xi = np.sqrt(pattern.alpha[tension, 0, 0] ** 2 - pattern.beta[tension, 0, 0] ** 2)
        expected = ORDERS * np.sqrt(xi**2 + (ORDERS * np.pi) ** 2)
        np.testing.assert_allclose(_ratios(pattern, tension, 0), expected / expected[0], rtol=1e-9)


@pytest.mark.parametrize("spring_n_m_rad", [0.0, 1e6, np.inf])
def test_some_pattern_of_the_grid_fits_a_hanger_by_finite_elements(spring_n_m_rad: float) -> None:
    """The grid is coarse, a yardstick: every order within 1.5 %."""
    hanger = Hanger(1, 12.0, 200e9, 0.0133, 1.4e-5, 103.5, 711e3)
    state = HangerState(711e3, *(4 * (spring_n_m_rad,)))
    logs = np.log(natural_frequencies(hanger, state, 8)[0])
    difference = logs - tensioned_beam_pattern().log_frequency[..., :8]
    misfit = np.abs(difference - difference.mean(axis=-1, keepdims=True)).max(axis=-1)
    assert misfit.min() < 0.015


def test_shapes_vanish_at_both_ends_and_have_one_more_node_each_order() -> None:
    pattern = tensioned_beam_pattern()
    position = np.linspace(0, 1, 401)
    stiff = pattern.shapes(position, np.arange(20, 60))[:, :, :6]
    assert np.abs(stiff[..., [0, -1]]).max() < 0.01 * np.abs(stiff).max()
    inner = stiff[..., 20:-20]
    nodes = np.sum(np.diff(np.sign(inner), axis=-1) != 0, axis=-1)
    assert np.all(nodes == np.arange(6))


def test_it_holds_many_orders() -> None:
    assert tensioned_beam_pattern().beta.shape[-1] == HIGHEST_ORDER
