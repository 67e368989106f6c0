"""Bars under compression: fine elements below the buckling load, no failure beyond it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.hanger import PhysicalHanger, Zone
from tests.helpers.physical_hangers import EI, LENGTH, MASS, clamped, elements_hz, frequencies_hz

START, END = 2.0, 5.0
EULER_N = 4 * np.pi**2 * EI / LENGTH**2


def compressed(force_n: float, stiffness: float = 1.0, mass: float = 1.0) -> PhysicalHanger:
    """Return a clamped bar under a compression, with other properties from START to END."""
    one = np.ones(1)
    zone = Zone(START * one, END * one, stiffness * one, mass * one)
    return replace(clamped(), tension_n=-force_n * one, zones=(zone,))


@pytest.mark.parametrize(("stiffness", "mass"), [(0.2, 1.0), (1.0, 0.1), (0.3, 3.0)])
def test_solve_compressed_zone(stiffness: float, mass: float) -> None:
    force_n = 0.3 * EULER_N
    expected = elements_hz(
        lambda x: EI * (stiffness if START < x < END else 1),
        lambda x: MASS * (mass if START < x < END else 1),
        [START, END],
        5,
        tension=-force_n,
    )
    found = frequencies_hz(compressed(force_n, stiffness, mass), 5)[0, 0]
    np.testing.assert_allclose(found, expected, rtol=3e-4)


@pytest.mark.parametrize("loads", [1.5, 30, 600])
@pytest.mark.parametrize(("stiffness", "mass"), [(0.02, 1.0), (1.0, 0.02), (1.0, 1.5)])
def test_solve_buckled_zone(stiffness: float, mass: float, loads: float) -> None:
    found = frequencies_hz(compressed(loads * EULER_N, stiffness, mass), 5)[0, 0]
    assert np.isfinite(found).all()
    assert found[0] < 1e-3  # a buckled bar does not swing
