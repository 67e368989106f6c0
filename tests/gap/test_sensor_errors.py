"""What many modes say of a sensor is told of the sensor, in the measurement's name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.residuals import sensor_remarks
from shm.gap.search import fit_alone
from shm.simulate import HangerState
from shm.values import Hanger, ModalTest, Scatter
from tests.helpers.gap_campaigns import problem_of
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign

PLAIN = replace(HANGER_3, plate=None)
PLAN = CampaignPlan(
    modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0, as_made=False, shape_sd=2e-3
)


def _measured(seed: int) -> ModalTest:
    (test,) = campaign(PLAIN, HangerState(711e3), (), PLAN, np.random.default_rng(seed))
    return test


def _mounted(test: ModalTest, sensor: int, turn_deg: float, gain: float) -> ModalTest:
    """A sensor turned from the transverse to the longitudinal plane, reading too much along it."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    modes = []
    for mode in test.modes:
        points = list(mode.shape)
        point = points[sensor]
        t, u = point.value, point.cross
        if mode.plane == "longitudinal":
            t, u = u, t
        t, u = (c * t + s * u) * (1 + gain), c * u - s * t
        value, cross = (t, u) if mode.plane == "transverse" else (u, t)
        points[sensor] = replace(point, value=value, cross=cross)
        modes.append(replace(mode, shape=tuple(points)))
    return replace(test, modes=tuple(modes))


def _told(test: ModalTest, hanger: Hanger = PLAIN) -> str:
    problem = problem_of([test], hanger=hanger)
    return " ".join(sensor_remarks(problem, fit_alone(problem, np.random.default_rng(1))))


def test_a_turned_sensor_that_reads_too_much_is_told_with_its_errors() -> None:
    test = _measured(1)
    place = test.modes[0].shape[1].x_m
    told = _told(_mounted(test, 1, 2.0, 0.04))
    assert "no part of the gap" in told
    turned = told.split(f"the sensor at {place:.2f} m is turned by ")[1].split(" degrees")[0]
    mean, sd = map(float, turned.split(" +- "))
    assert mean == pytest.approx(2.0, abs=max(3 * sd, 0.2))
    assert f"the sensor at {place:.2f} m reads" in told
    assert "too much transverse" in told


def test_of_sensors_as_they_should_be_nothing_is_told() -> None:
    assert not any(_told(_measured(seed)) for seed in range(4))


def test_the_owners_figures_replace_the_usual_ones() -> None:
    """Who has aligned the sensors to a tenth of a degree does not hear that one is turned by two;
    what differs then is left to the hanger."""
    test = _mounted(_measured(1), 1, 2.0, 0.0)
    exact = replace(PLAIN, scatter=Scatter(sensor_turn_deg=0.01, sensor_cross_axis=1e-4))
    assert "turned" in _told(test)
    assert "turned by 2" not in _told(test, exact)


def test_an_axis_that_hears_the_other_is_told() -> None:
    """Both by 2 %, which no turn does."""
    (test, place) = (one := _measured(1)), one.modes[0].shape[1].x_m
    modes = []
    for mode in test.modes:
        points = list(mode.shape)
        value, cross = points[1].value, points[1].cross
        points[1] = replace(points[1], value=value + 0.02 * cross, cross=cross + 0.02 * value)
        modes.append(replace(mode, shape=tuple(points)))
    told = _told(replace(test, modes=tuple(modes)))
    assert f"the sensor at {place:.2f} m reads 2.0 +- " in told
    assert "% of each axis in the other" in told
