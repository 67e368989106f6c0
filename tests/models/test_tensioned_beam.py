"""The exact beam against closed forms, an independent discretisation and the counting of nodes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Legendre
from scipy.linalg import eigh
from scipy.optimize import brentq

from shm.models.tensioned_beam import frequencies_hz, mode_shape, wave_numbers

PINNED, CLAMPED = np.array(0.0), np.array(np.inf)


def dimensionless_frequencies(xi: float, ka: float, kb: float, modes: int) -> np.ndarray:
    q = wave_numbers(np.array(xi), np.array(ka), np.array(kb), modes)
    return q * np.hypot(xi, q)


@pytest.mark.parametrize("xi", [0.0, 1e-6, 1.0, 20.0, 1000.0])
def test_pinned_ends_give_the_closed_form(xi: float) -> None:
    """Omega_n = n pi sqrt(xi^2 + n^2 pi^2)."""
    n = np.arange(1, 31) * np.pi
    expected = n * np.sqrt(xi**2 + n**2)
    np.testing.assert_allclose(dimensionless_frequencies(xi, 0, 0, 30), expected, rtol=1e-12)


def test_a_clamped_beam_without_tension_gives_the_classical_roots() -> None:
    """cos q cosh q = 1, written without overflow as cos q = 1 / cosh q."""
    roots = [
        brentq(
            lambda q: np.cos(q) - 1 / np.cosh(q), (n + 0.2) * np.pi, (n + 0.8) * np.pi, xtol=1e-13
        )
        for n in range(1, 13)
    ]
    np.testing.assert_allclose(wave_numbers(np.array(0.0), CLAMPED, CLAMPED, 12), roots, rtol=1e-12)


def test_a_clamped_and_pinned_beam_without_tension_gives_the_classical_roots() -> None:
    """tan q = tanh q."""
    roots = [
        brentq(lambda q: np.sin(q) - np.cos(q) * np.tanh(q), n * np.pi, (n + 0.5) * np.pi)
        for n in range(1, 13)
    ]
    np.testing.assert_allclose(wave_numbers(np.array(0.0), CLAMPED, PINNED, 12), roots, rtol=1e-11)


def test_a_string_is_the_limit_of_no_bending_stiffness() -> None:
    """f_n = n/(2 L) sqrt(T/m)."""
    length, tension, mass = 12.0, 711e3, 103.5
    one = np.array(1.0)
    found = frequencies_hz(length * one, tension * one, 1e-6 * one, mass * one, PINNED, PINNED, 10)
    expected = np.arange(1, 11) / (2 * length) * np.sqrt(tension / mass)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_clamped_string_of_little_stiffness_follows_its_asymptote() -> None:
    """Omega_n = n pi xi (1 + 2/xi + (4 + n^2 pi^2/2)/xi^2 + ...) (Morse 1948)."""
    xi, n = 1000.0, np.arange(1, 4)
    expected = n * np.pi * xi * (1 + 2 / xi + (4 + n**2 * np.pi**2 / 2) / xi**2)
    found = dimensionless_frequencies(xi, np.inf, np.inf, 3)
    np.testing.assert_allclose(found, expected, rtol=2e-7)


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
    half = weights / 2
    stiffness = (curve * half) @ curve.T + xi**2 * (slope * half) @ slope.T
    stiffness += ka * np.outer(ends[:, 0], ends[:, 0]) + kb * np.outer(ends[:, 1], ends[:, 1])
    mass = (value * half) @ value.T
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[:modes])


@pytest.mark.parametrize("xi", [0.0, 0.3, 5.0, 30.0, 100.0])
@pytest.mark.parametrize(("ka", "kb"), [(0.0, 0.0), (0.01, 3.0), (10.0, 500.0), (2e4, 1e-3)])
def test_an_independent_discretisation_agrees(xi: float, ka: float, kb: float) -> None:
    expected = galerkin(xi, ka, kb, modes=10, degree=30 if xi <= 5 else 60)
    np.testing.assert_allclose(dimensionless_frequencies(xi, ka, kb, 10), expected, rtol=1e-6)


def crossings(shape: np.ndarray) -> int:
    """Changes of sign between the ends; a point on a node counts for neither side."""
    clear = shape[1:-1][np.abs(shape[1:-1]) > 1e-9]
    return int(np.sum(np.sign(clear[1:]) != np.sign(clear[:-1])))


springs = st.one_of(st.just(0.0), st.floats(-6, 15).map(lambda e: 10.0**e), st.just(np.inf))


@settings(max_examples=300, deadline=None)
@given(xi=st.floats(0, 1000), ka=springs, kb=springs, order=st.integers(1, 15))
@example(xi=1000.0, ka=1e15, kb=1e15, order=15)
@example(xi=0.0, ka=1e15, kb=0.0, order=1)
def test_no_mode_is_missed_or_doubled(xi: float, ka: float, kb: float, order: int) -> None:
    """Mode n of a beam under tension crosses zero n - 1 times, so its number counts the modes."""
    q = wave_numbers(np.array(xi), np.array(ka), np.array(kb), order)
    assert np.all(np.diff(q) > 2.0)
    x = np.linspace(0, 1, 40 * order + 3)
    assert crossings(mode_shape(xi, ka, kb, order, x)) == order - 1


@settings(max_examples=200, deadline=None)
@given(xi=st.floats(0, 1000), ka=springs, kb=springs)
def test_a_stiffer_end_never_lowers_a_frequency(xi: float, ka: float, kb: float) -> None:
    softer = dimensionless_frequencies(xi, ka, kb, 8)
    stiffer = dimensionless_frequencies(xi, ka * 3 + 1, kb, 8)
    assert np.all(stiffer >= softer * (1 - 1e-13))


@settings(max_examples=100, deadline=None)
@given(xi=st.floats(0, 1000), ka=springs, kb=springs)
def test_the_ends_can_be_exchanged(xi: float, ka: float, kb: float) -> None:
    one, other = dimensionless_frequencies(xi, ka, kb, 8), dimensionless_frequencies(xi, kb, ka, 8)
    np.testing.assert_allclose(one, other, rtol=1e-13)


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


def test_a_shape_is_scaled_to_one_and_starts_positive() -> None:
    x = np.linspace(0, 1, 2001)
    for order in range(1, 9):
        shape = mode_shape(25.0, 10.0, np.inf, order, x)
        assert np.abs(shape).max() == pytest.approx(1, abs=1e-3)
        assert shape[5] > 0


def test_parameter_sets_are_solved_at_once_as_one_by_one() -> None:
    rng = np.random.default_rng(0)
    xi, ka, kb = rng.uniform(0, 200, 50), 10 ** rng.uniform(-2, 6, 50), 10 ** rng.uniform(-2, 6, 50)
    together = wave_numbers(xi, ka, kb, 8)
    alone = [
        wave_numbers(np.array(x), np.array(a), np.array(b), 8)
        for x, a, b in zip(xi, ka, kb, strict=True)
    ]
    np.testing.assert_allclose(together, alone, rtol=1e-14)
