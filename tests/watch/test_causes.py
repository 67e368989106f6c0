"""What causes do to frequencies: against other descriptions of the same bar."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.models import described
from shm.models.base import Conditions
from shm.models.end_effects import coupled_bar
from shm.models.hanger import PointMass, solve
from shm.models.hanger.physical import Zone
from shm.values import PLANES, FloatArray
from shm.watch.causes import (
    BENDING_STIFFNESS,
    POINT_MASS,
    SECTION_LOSS,
    TIMEBASE,
    UNEXPLAINED,
    hypotheses_of,
)
from shm.watch.options import WatchOptions
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import (
    BOTH_ENDS,
    MODES,
    PLANES_ALONE,
    TENSION_ALONE,
    columns,
)

BASE = np.array([1.0, 1.0, 7.0, 7.0, 7.0, 7.0])
MASS_KG = HANGER_3.mass_per_length_kg_m * HANGER_3.length_m


@cache
def bar():  # type: ignore[no-untyped-def]
    """The same hanger by the general bar."""
    one = np.ones(1)
    tension_n = HANGER_3.nominal_tension_n * one
    plain = coupled_bar(HANGER_3, HANGER_3.length_m * one, tension_n)
    return plain.on_springs(described("beam2", HANGER_3).springs_n_m_rad(BASE[None]))


def log_hz(physical) -> FloatArray:  # type: ignore[no-untyped-def]
    found = solve(physical, 7, np.empty(0), shapes=False).frequency_hz[0]
    return np.array([np.log(found[PLANES.index(plane), order - 1]) for plane, order in MODES])


def central(change) -> FloatArray:  # type: ignore[no-untyped-def]
    """Per unit: a small step to both sides, where the columns are of one step of a tenth."""
    step = 0.02
    return (log_hz(change(step)) - log_hz(change(-step))) / (2 * step)


def test_the_general_bar_of_the_columns_is_that_of_the_model_class() -> None:
    found = described("beam2", HANGER_3).frequencies_at(BASE[None], 7, Conditions())[0]
    expected = [np.log(found[PLANES.index(plane), order - 1]) for plane, order in MODES]

    assert log_hz(bar()) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize(("row", "place"), [(0, 0.06), (4, 0.36), (6, 0.5)])
def test_a_mass_at_a_place_lowers_each_mode_as_by_rayleigh(row: int, place: float) -> None:
    def laden(units: float, place: float = place):  # type: ignore[no-untyped-def]
        mass = PointMass(
            place * HANGER_3.length_m * np.ones(1), units * 0.01 * MASS_KG * np.ones(1)
        )
        return replace(bar(), masses=(*bar().masses, mass))

    found, way = columns().by_cause[POINT_MASS][row]

    # By three hundredths at once, less than three times one.
    assert found == pytest.approx(central(laden), rel=0.2, abs=1e-4)
    assert 3 * found == pytest.approx(log_hz(laden(3.0)) - log_hz(bar()), rel=1e-4, abs=1e-7)
    assert found.max() <= 1e-9
    # Half way to the next place is 1.7 sd along the way, as far as it is straight.
    between = (log_hz(laden(3.0, place - 0.035)) - log_hz(bar())) / 3
    low = np.array([order <= 4 for _, order in MODES])
    assert (found - math.sqrt(3) * way)[low] == pytest.approx(between[low], rel=0.3, abs=2e-3)
    # In the middle the second mode stands still, and the first goes by about the mass's share.
    if place == 0.5:
        assert found[MODES.index(("transverse", 2))] == pytest.approx(0, abs=1e-4)
        assert -0.015 < found[MODES.index(("transverse", 1))] < -0.009


def test_section_lost_and_stiffness_gained_are_their_finite_differences() -> None:
    def lost(units: float):  # type: ignore[no-untyped-def]
        left, length = 1 - 0.05 * units, HANGER_3.length_m
        start, end = (0.25 - 0.075) * length * np.ones(1), (0.25 + 0.075) * length * np.ones(1)
        zone = Zone(start, end, left**2 * np.ones(1), left * np.ones(1))
        return replace(bar(), zones=(*bar().zones, zone))

    def stiffened(units: float):  # type: ignore[no-untyped-def]
        stiffness = bar().bending_stiffness_n_m2 * (1 + 0.03 * units)
        return replace(bar(), bending_stiffness_n_m2=stiffness)

    (of_loss,) = columns().by_cause[SECTION_LOSS][1]
    ((of_stiffness,),) = columns().by_cause[BENDING_STIFFNESS]
    assert of_loss == pytest.approx(central(lost), rel=0.05, abs=2e-5)
    assert of_stiffness == pytest.approx(central(stiffened), rel=0.03, abs=1e-5)
    assert of_stiffness.min() > 0


def test_a_clock_moves_all_modes_alike_and_sensors_lower_them() -> None:
    assert np.ptp(columns().by_cause[TIMEBASE]) == 0
    spread = np.linalg.eigvalsh(columns().sensors)
    assert spread.min() > -1e-12
    assert 0 < spread.max() < 1e-4


@pytest.mark.parametrize("quantities", [TENSION_ALONE, PLANES_ALONE, BOTH_ENDS])
def test_the_prior_of_all_causes_together_is_one(quantities: tuple) -> None:  # type: ignore[type-arg]
    found = hypotheses_of(quantities, columns(), WatchOptions())
    chances: dict[str, float] = {}
    for each in found.directions:
        chances[each.name] = chances.get(each.name, 0.0) + np.exp(each.log_prior)

    assert sum(chances.values()) == pytest.approx(1.0)
    assert chances[UNEXPLAINED] == pytest.approx(0.07)
    assert len(found.scatter_variance) == len(quantities) + found.scattering.shape[1]
    assert set(found.names) >= {each.name for each in quantities} | {POINT_MASS, TIMEBASE}
