"""The tension by two equal springs, on the exact beam with such and with other ends."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from shm.models.classes.equal_springs import VALID_FROM_XI, WORST_ERROR, tension_n
from shm.models.classes.tensioned_beam import frequencies_hz

LENGTH_M, MASS_KG_M, STIFFNESS_N_M2 = 9.0, 80.0, 2e5
BAR = (LENGTH_M, MASS_KG_M, STIFFNESS_N_M2)
UNIT_N, UNIT_N_M = STIFFNESS_N_M2 / LENGTH_M**2, STIFFNESS_N_M2 / LENGTH_M


def found_over_true(xi: float, deck: float, arch: float, orders: tuple[int, ...]) -> float:
    """By the exact frequencies of those orders, with springs k L/EI at the ends."""
    length, tension, *springs = (
        np.full(1, value) for value in (LENGTH_M, xi**2 * UNIT_N, deck * UNIT_N_M, arch * UNIT_N_M)
    )
    stiffness, mass = np.asarray(STIFFNESS_N_M2), np.asarray(MASS_KG_M)
    hz = frequencies_hz(length, tension, stiffness, mass, *springs, max(orders))[0]
    return tension_n({n: float(hz[n - 1]) for n in orders}, *BAR) / (xi**2 * UNIT_N)


@pytest.mark.parametrize(
    ("xi", "spring"), [*product((VALID_FROM_XI, 12.0, 200.0), (0.05, 10, np.inf))]
)
def test_on_equal_springs_it_is_exact(xi: float, spring: float) -> None:
    assert found_over_true(xi, spring, spring, (1, 2, 3, 4, 5, 6)) == pytest.approx(
        1, abs=WORST_ERROR
    )


@pytest.mark.parametrize(("xi", "error"), [(6.0, -0.14), (50.0, -0.011)])
def test_one_soft_and_one_clamped_end_make_it_err(xi: float, error: float) -> None:
    """What it leaves out: the frequencies fit well, and the tension is too low."""
    found = found_over_true(xi, 10.0, np.inf, (1, 2, 3, 4, 5, 6))
    assert found - 1 == pytest.approx(error, rel=0.1)
