"""The beam that shears against closed forms, its limit, and other models of the same physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from shm.models import described
from shm.models.classes import tensioned_beam
from shm.values import FloatArray
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import EI, LENGTH, MASS, TENSION
from tests.helpers.timoshenko import legendre_hz

NU = HANGER_3.poissons_ratio
SHEAR = (
    6 * (1 + NU) / (7 + 6 * NU) * HANGER_3.elastic_modulus_pa / (2 * (1 + NU)) * HANGER_3.area_m2
)
GYRATION = np.sqrt(HANGER_3.second_moment_m4 / HANGER_3.area_m2)


def found_hz(
    deck: object,
    arch: object,
    modes: int,
    length_m: object = LENGTH,
    tension_n: object = TENSION,
    shear_n: object = SHEAR,
    gyration_m: object = GYRATION,
) -> FloatArray:
    bar = map(np.asarray, (length_m, tension_n, EI, MASS, deck, arch))
    section = 1 / np.asarray(shear_n), np.asarray(gyration_m)
    return tensioned_beam.frequencies_hz(*bar, modes, *section)


@pytest.mark.parametrize("length_m", [2.0, 3.0, 12.0])
@pytest.mark.parametrize("tension_n", [1e3, TENSION, 5 * TENSION])
def test_pinned_ends_give_the_closed_form(length_m: float, tension_n: float) -> None:
    """w = a sin qx and psi = b cos qx, q = n pi/L, satisfy the ends: two equations for a and b.

    Of their energies the smaller eigenvalue is omega^2.
    """
    found = found_hz(0.0, 0.0, 10, length_m, tension_n)
    np.testing.assert_allclose(found, pinned_hz(length_m, tension_n, 10), rtol=1e-9)


def pinned_hz(length_m: float, tension_n: float, modes: int) -> FloatArray:
    """Return the frequencies (modes,) of a bar on hinges from its two energies."""
    expected = []
    for q in np.arange(1, modes + 1) * np.pi / length_m:
        stiffness = [[(SHEAR + tension_n) * q**2, -SHEAR * q], [-SHEAR * q, EI * q**2 + SHEAR]]
        inertia = np.diag([MASS, MASS * GYRATION**2])
        expected.append(np.sqrt(eigh(stiffness, inertia, eigvals_only=True)[0]) / (2 * np.pi))
    return np.array(expected)


@pytest.mark.parametrize("tension_n", [1e4, 5 * TENSION])
@pytest.mark.parametrize(("deck", "arch"), [(0.0, 1e5), (3e6, 3e6), (1e4, 1e8)])
def test_a_short_bar_on_springs_is_that_of_another_discretisation(
    tension_n: float, deck: float, arch: float
) -> None:
    expected = legendre_hz(HANGER_3, 2.0, tension_n, 6, (deck, arch))
    np.testing.assert_allclose(found_hz(deck, arch, 6, 2.0, tension_n), expected, rtol=1e-8)


@pytest.mark.parametrize("length_m", [2.0, 6.0])
def test_no_mode_is_missed_or_doubled_in_a_short_thick_bar(length_m: float) -> None:
    """Each spring raises a mode from the pinned bar's towards the clamped bar's, never beyond."""
    springs = np.logspace(2, 11, 40)
    found = found_hz(springs, springs, 10, length_m)
    pinned, clamped = (found_hz(k, k, 10, length_m) for k in (0.0, np.inf))
    assert np.all(np.diff(found, axis=0) > 0)
    assert np.all((found > pinned) & (found < clamped))


@pytest.mark.parametrize("tension_n", [1.0, TENSION, 1e9])
def test_timoshenko_pinned_beyond_cutoff(tension_n: float) -> None:
    """Keep modes below the cut-off, also where the search passes it; those beyond are unknown."""
    lengths_m = np.geomspace(0.02, 2.0, 60)
    expected = np.array([pinned_hz(each, tension_n, 8) for each in lengths_m])
    expected[expected >= cutoff_hz()] = np.nan
    assert np.isnan(expected).any(axis=0).all()
    np.testing.assert_allclose(found_hz(0.0, 0.0, 8, lengths_m, tension_n), expected, rtol=1e-9)


def cutoff_hz() -> float:
    """Return the frequency from which sections swing by themselves."""
    return float(np.sqrt(SHEAR / MASS) / (2 * np.pi * GYRATION))


def test_beam_3_is_this_beam_and_beam_2_its_limit_for_slender_bars() -> None:
    model = described("beam3", HANGER_3)
    springs = {"log10_k1": 6.0, "log10_k2": 6.5, "log10_k3": 7.0, "log10_k4": 7.5}
    theta = model.pack({"theta_F": 1.0, "theta_L": 0.9, **springs})[None]
    found = model.frequencies_hz(theta, 6)[0]
    expected = found_hz(np.array([1e6, 10**6.5]), np.array([1e7, 10**7.5]), 6, 0.9 * LENGTH)
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    slender = replace(HANGER_3, length_m=120.0)
    both = [described(name, slender).frequencies_hz(theta, 3) for name in ("beam2", "beam3")]
    np.testing.assert_allclose(both[1], both[0], rtol=1e-4)
