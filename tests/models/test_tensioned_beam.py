"""The exact beam against closed forms, an independent discretisation and counts of its modes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.linalg import eigh, null_space
from scipy.optimize import brentq

from shm.models.classes.tensioned_beam import wave_numbers
from tests.helpers.beam_count import modes_below
from tests.helpers.beam_shapes import mode_shape

PINNED, CLAMPED = np.array(0.0), np.array(np.inf)


def dimensionless_frequencies(xi: float, ka: float, kb: float, modes: int) -> np.ndarray:
    q = wave_numbers(np.array(xi) ** 2, np.array(ka), np.array(kb), modes)
    return q * np.hypot(xi, q)


@pytest.mark.parametrize("xi", [0.0, 1e-6, 0.05, 1.0, 20.0, 2000.0])
def test_pinned_ends_give_the_closed_form(xi: float) -> None:
    """q_n = n pi, so that Omega_n = n pi sqrt(xi^2 + n^2 pi^2)."""
    n = np.arange(1, 41) * np.pi
    expected = n * np.sqrt(xi**2 + n**2)
    np.testing.assert_allclose(dimensionless_frequencies(xi, 0, 0, 40), expected, rtol=1e-14)


def test_a_clamped_beam_without_tension_gives_the_classical_roots() -> None:
    """cos q cosh q = 1, written without overflow as cos q = 1 / cosh q."""
    roots = [
        brentq(
            lambda q: np.cos(q) - 1 / np.cosh(q), (n + 0.2) * np.pi, (n + 0.8) * np.pi, xtol=1e-13
        )
        for n in range(1, 13)
    ]
    np.testing.assert_allclose(wave_numbers(np.array(0.0), CLAMPED, CLAMPED, 12), roots, rtol=1e-12)


def galerkin(xi: float, ka: float, kb: float, modes: int, degree: int) -> np.ndarray:
    """Omega of the first modes from Legendre polynomials that vanish at both ends.

    The energies are integrated by Gauss quadrature: nothing is shared with the solver under test.
    """
    nodes, weights = np.polynomial.legendre.leggauss(degree + 3)
    basis = [Legendre.basis(j + 2) - Legendre.basis(j) for j in range(degree)]
    scale = np.array([1 / np.sqrt(4 * j + 6) for j in range(degree)])[:, None]
    value, slope, curve = (
        scale * 2**d * np.array([(b.deriv(d) if d else b)(nodes) for b in basis]) for d in range(3)
    )
    ends = scale * 2 * np.array([b.deriv(1)(np.array([-1.0, 1.0])) for b in basis])
    half, springs = weights / 2, np.array([ka, kb])
    clamped = np.isinf(springs)
    stiffness = (curve * half) @ curve.T + xi**2 * (slope * half) @ slope.T
    stiffness += (ends * np.where(clamped, 0, springs)) @ ends.T
    mass = (value * half) @ value.T
    free = null_space(ends[:, clamped].T) if clamped.any() else np.eye(degree)
    found = eigh(free.T @ stiffness @ free, free.T @ mass @ free, eigvals_only=True)
    return np.sqrt(found[:modes])


@pytest.mark.parametrize("xi", [0.0, 0.3, 5.0, 30.0, 100.0])
@pytest.mark.parametrize(
    ("ka", "kb"),
    [(0, 0), (0.01, 3), (10, 500), (2e4, 1e-3), (np.inf, 7), (0, np.inf), (np.inf, np.inf)],
)
def test_an_independent_discretisation_agrees(xi: float, ka: float, kb: float) -> None:
    expected = galerkin(xi, ka, kb, modes=10, degree=30 if xi <= 5 else 60)
    np.testing.assert_allclose(dimensionless_frequencies(xi, ka, kb, 10), expected, rtol=1e-6)


def assert_counted(xi: np.ndarray, ka: np.ndarray, kb: np.ndarray, modes: int) -> None:
    """Root n has exactly n - 1 frequencies just below it and n just above: none missed or doubled.

    The count is made 1e-11 of the root to either side, which proves its value too.
    """
    q = wave_numbers(xi**2, ka, kb, modes).astype(np.longdouble)
    columns = [np.asarray(values, dtype=np.longdouble)[..., None] for values in (xi, ka, kb)]
    order = np.broadcast_to(np.arange(1, modes + 1), q.shape)
    np.testing.assert_array_equal(modes_below(q * (1 - 1e-11), *columns), order - 1)
    np.testing.assert_array_equal(modes_below(q * (1 + 1e-11), *columns), order)


def test_the_count_of_modes_agrees_over_all_tensions_and_springs() -> None:
    rng = np.random.default_rng(2)
    xi, (ka, kb) = 10 ** rng.uniform(-1.31, 3.31, 4000), 10 ** rng.uniform(-6, 8, (2, 4000))
    ka[::5], kb[::7], ka[1::9], kb[2::8] = np.inf, np.inf, 0, 0
    assert_counted(xi, ka, kb, 40)


@pytest.mark.parametrize("xi", [0.0, 25.0, 300.0])
@pytest.mark.parametrize(("ka", "kb"), [(0.0, 0.0), (40.0, 3.0), (1e4, 0.0), (1e15, 1e15)])
def test_a_shape_has_the_energy_of_its_frequency(xi: float, ka: float, kb: float) -> None:
    """Rayleigh: Omega^2 = (int u''^2 + xi^2 int u'^2 + springs) / int u^2."""
    order, x = 3, np.linspace(0, 1, 40001)
    u = mode_shape(xi, ka, kb, order, x)
    np.testing.assert_allclose(u[[0, -1]], 0, atol=1e-9)
    slope = np.gradient(u, x, edge_order=2)
    curve = np.gradient(slope, x, edge_order=2)
    energy = np.trapezoid(curve**2 + xi**2 * slope**2, x)
    if max(ka, kb) < 1e14:
        energy += ka * slope[0] ** 2 + kb * slope[-1] ** 2
    omega = dimensionless_frequencies(xi, ka, kb, order)[-1]
    assert np.sqrt(energy / np.trapezoid(u**2, x)) == pytest.approx(omega, rel=1e-4)
