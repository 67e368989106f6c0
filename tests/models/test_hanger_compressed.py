"""Bars under compression: fine elements below the buckling load, no failure beyond it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.hanger import PhysicalHanger, Zone, solve
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import EI, LENGTH, MASS, elements_hz, frequencies_hz

START, END = 2.0, 5.0
EULER_N = 4 * np.pi**2 * EI / LENGTH**2  # of a clamped bar


def zone(n: int, start: float, end: float, stiffness: float, mass: float) -> tuple[Zone, ...]:
    return (Zone(*(np.full(n, each) for each in (start, end, stiffness, mass))),)


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
    bar = PhysicalHanger.clamped(HANGER_3, np.array([-force_n]))
    bar = replace(bar, zones=zone(1, START, END, stiffness, mass))
    np.testing.assert_allclose(frequencies_hz(bar, 5)[0, 0], expected, rtol=3e-4)


def weak_and_light(n: int) -> dict[str, object]:
    return {"zones": zone(n, START, END, 0.02, 0.3)}


def heavy_millimetre(n: int) -> dict[str, object]:
    """Return a zone so short that functions are nearly dependent: rounding decides."""
    return {"zones": zone(n, 0.7 * LENGTH, 0.7001 * LENGTH, 1.0, 1.5)}


def hinged_and_free_end(n: int) -> dict[str, object]:
    sideways, turning = np.zeros((n, 2, 2)), np.zeros((n, 2, 2, 2))
    sideways[:, 0] = np.inf
    turning[..., [0, 1], [0, 1]] = np.inf
    return {"translational_compliance_m_n": sideways, "rotational_compliance_rad_n_m": turning}


def deep_sag(n: int) -> dict[str, object]:
    return {"sag_parameter": np.full((n, 2), 20.0)}


@pytest.mark.parametrize("shapes", [False, True])
@pytest.mark.parametrize("make", [weak_and_light, heavy_millimetre, hinged_and_free_end, deep_sag])
def test_solve_beyond_buckling(make, shapes: bool) -> None:
    tension = -np.geomspace(0.01, 600.0, 24) * EULER_N
    bar = PhysicalHanger.clamped(HANGER_3, tension)
    found = solve(replace(bar, **make(len(tension))), 4, np.array([1.0, 5.0]), shapes)
    assert np.isfinite(np.log(found.frequency_hz)).all()
    assert np.all(found.frequency_hz[-1] < 0.01)  # a buckled bar does not swing
