"""Modes of two planes that all but coincide swing in any direction: that is no gap."""

import math

import numpy as np
import pytest

from shm.api import round_bar
from shm.gap import diagnose
from shm.values import PLANES, Diagnosis, ModalTest, Mode, ShapePoint
from shm.values.verdict import Outcome, judge
from tests.worlds.bars import Bar, solve_modes

LENGTH_M, DIAMETER_M, TENSION_N, TURN = 8.4, 0.055, 325e3, math.radians(35)
PLACES_M = (1.1, 2.3, 3.7)
SD, SHAPE_SD = 1e-4, 1e-3


def measured(apart: float, oval: float = 0.0) -> Diagnosis:
    """Diagnose a sound bar whose planes lie 35 degrees askew.

    Its ends differ by the fraction `apart` between them, its bending stiffness by twice `oval`.
    """
    rng = np.random.default_rng(3)
    bending = 2.1e11 * math.pi * DIAMETER_M**4 / 64
    mass = 7850 * math.pi * DIAMETER_M**2 / 4
    springs = 2.0 * math.sqrt(bending * TENSION_N)
    modes = []
    for plane, side in enumerate((-1, 1)):
        ends = 2 * (springs * (1 + side * apart / 2),)
        stiffness = bending * (1 + side * oval)
        bar = Bar(LENGTH_M, TENSION_N, stiffness, mass, rotation_n_m_rad=ends)
        found = solve_modes(bar, 6, PLACES_M)
        shapes = (found.shapes / abs(found.shapes).max(axis=0)).T
        for order, (hz, shape) in enumerate(zip(found.frequencies_hz, shapes, strict=True)):
            noise = SHAPE_SD * rng.standard_normal((2, len(shape)))
            own = math.cos(TURN) * shape + noise[0]
            cross = side * math.sin(TURN) * shape + noise[1]
            points = tuple(
                ShapePoint(x, float(a), float(c), SHAPE_SD)
                for x, a, c in zip(PLACES_M, own, cross, strict=True)
            )
            hz *= math.exp(SD * rng.standard_normal())
            modes.append(Mode(PLANES[plane], order + 1, float(hz), SD * float(hz), shape=points))
    hanger = round_bar(
        1,
        diameter_m=DIAMETER_M,
        length_m=LENGTH_M,
        elastic_modulus_pa=2.1e11,
        density_kg_m3=7850,
        nominal_tension_n=300e3,
    )
    return diagnose([ModalTest("t", tuple(modes))], hanger)


@pytest.mark.parametrize(("apart", "oval"), [(0.01, 0.0), (0.03, 0.006)])
def test_pairs_that_all_but_coincide_swing_in_any_direction(apart: float, oval: float) -> None:
    found = measured(apart, oval)
    assert judge(found).outcome is Outcome.NO_GAP
    assert found.tension_after_n.q025 < TENSION_N < found.tension_after_n.q975


def test_pairs_far_apart_swing_in_their_planes() -> None:
    """An end that is twice as stiff in one plane tells the directions; 35 degrees are a gap."""
    found = measured(0.7)
    assert judge(found).outcome is not Outcome.NO_GAP
