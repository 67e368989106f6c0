"""Supports that give way, supports that move on their own mass, sag, and turned end springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.models.classes import tensioned_beam
from shm.models.hanger import PhysicalHanger, solve
from tests.helpers.physical_hangers import (
    EI,
    LENGTH,
    MASS,
    NOWHERE,
    TENSION,
    clamped,
    frequencies_hz,
    of_slenderness,
    on_springs,
)

UNIT_HZ = np.sqrt(TENSION / MASS) / (2 * np.pi)
LOOSE = np.zeros((1, 2))


def string() -> PhysicalHanger:
    """Pinned, and next to no bending stiffness."""
    return on_springs(of_slenderness(np.array([1e3])), LOOSE, LOOSE)


def supported(
    hanger: PhysicalHanger, end: int, compliance_m_n: float, mass_kg: float = 0.0
) -> PhysicalHanger:
    """Both planes alike."""
    compliance, mass = np.zeros((2, len(hanger.tension_n), 2, 2))
    compliance[:, end], mass[:, end] = compliance_m_n, mass_kg
    return replace(hanger, translational_compliance_m_n=compliance, support_mass_kg=mass)


def test_a_string_whose_end_moves_with_a_mass() -> None:
    """Spring s and mass M at one end: T k cos(k L) + (s - M omega^2) sin(k L) = 0 with omega^2 =
    k^2 T/m. The mode that the support alone would have, near sqrt(s/M), is not the hanger's."""
    mass_kg, support_hz = 20 * MASS * LENGTH, 4.0
    n_m = mass_kg * (2 * np.pi * support_hz) ** 2

    def fault(k: float) -> float:
        moved = n_m - mass_kg * k**2 * TENSION / MASS
        return float(TENSION * k * np.cos(k * LENGTH) + moved * np.sin(k * LENGTH))

    k = np.linspace(1e-3, 2.0, 4001)
    signs = np.sign([fault(each) for each in k])
    at = np.flatnonzero(signs[1:] != signs[:-1])
    roots = np.array([brentq(fault, k[i], k[i + 1]) for i in at]) * UNIT_HZ
    own = np.argmin(np.abs(roots - support_hz))
    expected = np.delete(roots, own)[:5]
    assert abs(roots[own] - support_hz) < 0.1
    hanger = supported(string(), 0, 1 / n_m, mass_kg)
    np.testing.assert_allclose(frequencies_hz(hanger, 5)[0, 0], expected, rtol=1e-3)
    with_shapes = solve(hanger, 5, np.array([6.0])).frequency_hz
    np.testing.assert_allclose(with_shapes, frequencies_hz(hanger, 5), rtol=1e-10)


def test_a_bar_hanging_from_one_end_has_a_cantilevers_modes() -> None:
    """Clamped at the arch end, free at the deck end: cosh q cos q = -1."""
    q = [
        brentq(lambda q: np.cos(q) + 1 / np.cosh(q), (n - 1) * np.pi + 0.1, n * np.pi)
        for n in range(1, 7)
    ]
    compliance = np.zeros((1, 2, 2))
    compliance[:, 0] = np.inf
    hanger = on_springs(of_slenderness(np.zeros(1)), LOOSE, LOOSE + np.inf)
    hanger = replace(hanger, translational_compliance_m_n=compliance)
    expected = np.square(q) * np.sqrt(EI / MASS) / LENGTH**2 / (2 * np.pi)
    np.testing.assert_allclose(frequencies_hz(hanger, 6)[0, 0], expected, rtol=1e-5)


@pytest.mark.parametrize("sag", [0.01, 1.0, 15.0])
def test_sag_is_irvines(sag: float) -> None:
    """Symmetric modes of a string: tan(w/2) = w/2 - (4/lambda^2) (w/2)^3 with w = omega L
    sqrt(m/T); antisymmetric ones at 2 n pi (Irvine and Caughey 1974)."""

    def fault(w: float) -> float:
        half = w / 2
        return float(np.sin(half) - (half - 4 / sag * half**3) * np.cos(half))

    ends = ((2 * n + 1, 2 * n + (1.9 if n else 2 - 2e-9)) for n in range(3))
    symmetric = [brentq(fault, low * np.pi * (1 - 1e-9), high * np.pi) for low, high in ends]
    waves = np.sort([*symmetric, *(2 * np.pi * np.arange(1, 4))]) / LENGTH
    sagging = replace(string(), sag_parameter=np.full((1, 2), sag))
    found = frequencies_hz(sagging, 6)[0, 0]
    np.testing.assert_allclose(found, waves * UNIT_HZ, rtol=1e-3)


def skewed(angle: float, k: float, ends=(0, 1)) -> PhysicalHanger:
    """Springs k about one axis, turned by `angle` from the transverse plane; rigid about the
    other."""
    axis = np.array([np.cos(angle), np.sin(angle)])
    compliance = np.zeros((1, 2, 2, 2))
    compliance[:, list(ends)] = np.outer(axis, axis) / k
    return replace(clamped(), rotational_compliance_rad_n_m=compliance)


@pytest.mark.parametrize("angle", [0.0, 0.2, np.pi / 4, 1.0, np.pi / 2, -0.7])
def test_turned_springs_keep_the_frequencies_and_turn_the_motion(angle: float) -> None:
    k = 3e6
    bar = (np.array([each]) for each in (LENGTH, TENSION, EI, MASS, k, k))
    straight = tensioned_beam.frequencies_hz(*bar, 8)[0]
    rigid = frequencies_hz(clamped(), 8)[0, 0]
    found = solve(skewed(angle, k), 8, np.array([2.0, 5.1]))
    both = np.sort(found.frequency_hz[0].ravel())
    np.testing.assert_allclose(both, np.sort([*straight, *rigid]), rtol=2e-6)
    soft_plane = 0 if abs(angle) < np.pi / 4 else 1
    if abs(abs(angle) - np.pi / 4) > 0.1:
        np.testing.assert_allclose(found.frequency_hz[0, soft_plane], straight, rtol=2e-6)
        tangent = found.shape[0, soft_plane, :, :, 1 - soft_plane]
        across = found.shape[0, soft_plane, :, :, soft_plane]
        expected = np.tan(angle) if soft_plane == 0 else 1 / np.tan(angle)
        np.testing.assert_allclose(tangent, expected * across, atol=1e-5)


@pytest.mark.parametrize("off", [-1e-2, -1e-4, -1e-9, 0.0, 1e-9, 1e-4, 1e-2])
def test_each_plane_keeps_an_unbroken_family_near_45_degrees(off: float) -> None:
    """Of each pair of neighbours one belongs to each plane, also with ends that differ."""
    rows = []
    for ends in ((0, 1), (0,)):
        found = solve(skewed(np.pi / 4 + off, 1e6, ends), 8, np.array([2.0]))
        frequency = found.frequency_hz[0]
        order = np.argsort(frequency.T.ravel(), kind="stable")
        np.testing.assert_array_equal(order // 2, np.repeat(np.arange(8), 2))
        assert np.all(np.diff(frequency, axis=1) > 0)
        rows.append(frequency)
    assert len(rows) == 2


def test_coupled_planes_of_different_stiffness() -> None:
    """The frequencies do not depend on which plane is called the first."""
    stiff = np.array([[EI, 1.7 * EI]])
    one = replace(skewed(0.5, 2e6), bending_stiffness_n_m2=stiff)
    other = replace(skewed(np.pi / 2 - 0.5, 2e6), bending_stiffness_n_m2=stiff[:, ::-1])
    np.testing.assert_allclose(
        solve(one, 6, NOWHERE).frequency_hz,
        solve(other, 6, NOWHERE).frequency_hz[:, ::-1],
        rtol=1e-9,
    )
