"""Fittings, supports and sensors near an end to first order, against the general model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models.classes.end_effects import EndWaves
from shm.models.hanger import PhysicalHanger, PointMass, Zone
from shm.values import FloatArray
from tests.helpers.physical_hangers import EI, LENGTH, MASS, TENSION, clamped, frequencies_hz
from tests.helpers.physical_hangers import on_springs as sprung

MODES = 8
RESTRAINTS = (0.05, 5.0, 1000.0)
"""k L/EI of both ends: turning, half held, held."""

TENSIONS = (0.1 * TENSION, 2 * TENSION)


def bar(restraint: float, tension_n: float) -> PhysicalHanger:
    both = np.full((1, 2), restraint * EI / LENGTH)
    return replace(sprung(clamped(), both, both), tension_n=np.full(1, tension_n))


def changed(before: PhysicalHanger, **changes: object) -> FloatArray:
    """By which ln f of each mode (modes,) is changed in the first plane."""
    after = replace(before, **changes)  # type: ignore[arg-type]
    pair = (frequencies_hz(each, MODES)[0, 0] for each in (after, before))
    return np.asarray(np.log(next(pair) / next(pair)))


def waves(restraint: float, tension_n: float) -> EndWaves:
    frequency = frequencies_hz(bar(restraint, tension_n), MODES)[0, 0]
    sets = (tension_n, EI, MASS, LENGTH, restraint * EI / LENGTH)
    return EndWaves.of(frequency, *(np.asarray(each) for each in sets))


@pytest.mark.parametrize("tension_n", TENSIONS)
@pytest.mark.parametrize("restraint", RESTRAINTS)
def test_a_support_that_gives_way(restraint: float, tension_n: float) -> None:
    give = np.zeros((1, 2, 2))
    give[0, 0] = 2e-9
    exact = changed(bar(restraint, tension_n), translational_compliance_m_n=give)
    felt = 2e-9 * waves(restraint, tension_n).give()
    # The other end is felt by the lowest mode of a bar that is as short as its waves.
    np.testing.assert_allclose(felt, exact, rtol=0.1, atol=0.01 * np.abs(exact).max())


@pytest.mark.parametrize("tension_n", TENSIONS)
@pytest.mark.parametrize("restraint", RESTRAINTS)
def test_a_fitting_four_times_as_stiff(restraint: float, tension_n: float) -> None:
    own = waves(restraint, tension_n)
    for length_m in (0.01 * LENGTH, 0.03 * LENGTH):
        zone = Zone(*(np.full(1, each) for each in (0.0, length_m, 4.0, 1.0)))
        exact = changed(bar(restraint, tension_n), zones=(zone,))
        stiffened, _ = own.fitting(length_m)
        np.testing.assert_allclose(
            0.75 * stiffened, exact, rtol=0.2, atol=0.02 * np.abs(exact).max()
        )


@pytest.mark.parametrize("tension_n", TENSIONS)
@pytest.mark.parametrize("restraint", RESTRAINTS)
def test_a_fitting_half_as_heavy_again(restraint: float, tension_n: float) -> None:
    length_m = 0.03 * LENGTH
    zone = Zone(*(np.full(1, each) for each in (0.0, length_m, 1.0, 1.5)))
    exact = changed(bar(restraint, tension_n), zones=(zone,))
    _, weighed = waves(restraint, tension_n).fitting(length_m)
    np.testing.assert_allclose(0.5 * weighed, exact, rtol=0.1, atol=0.03 * np.abs(exact).max())


@pytest.mark.parametrize("tension_n", TENSIONS)
@pytest.mark.parametrize("restraint", RESTRAINTS)
@pytest.mark.parametrize("x_m", [0.1 * LENGTH, 0.3 * LENGTH])
def test_a_sensor(restraint: float, tension_n: float, x_m: float) -> None:
    share = 1e-4
    mass = PointMass(np.full(1, x_m), np.full(1, share * MASS * LENGTH))
    exact = changed(bar(restraint, tension_n), masses=(mass,))
    felt = -share * waves(restraint, tension_n).deflection(x_m) ** 2
    np.testing.assert_allclose(felt, exact, atol=0.1 * np.abs(exact).max())
