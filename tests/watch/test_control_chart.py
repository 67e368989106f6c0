"""The control chart against closed forms, and against simulated campaigns of known truth."""

from __future__ import annotations

import math
from datetime import timedelta

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.values import ControlHanger, Summary
from shm.watch.control_chart import ControlChart, chart_control
from tests.helpers.workspaces import START

KNOWN_N, KNOWN_SD_N = 20e3, 100.0
ABSOLUTE, REPEATABILITY = 0.02, 0.002
REPEATS = math.hypot(REPEATABILITY, DEFAULTS.tension_between_tests.value)


def control() -> ControlHanger:
    """Return a weighed string."""
    return ControlHanger(
        id=90,
        length_m=3.0,
        elastic_modulus_pa=200e9,
        area_m2=1e-4,
        second_moment_m4=1e-9,
        mass_per_length_kg_m=0.78,
        nominal_tension_n=KNOWN_N,
        known_tension_n=KNOWN_N,
        known_tension_sd_n=KNOWN_SD_N,
    )


def charted(*deviations: float) -> ControlChart:
    tests = []
    for n, deviation in enumerate(deviations):
        mean_n, sd_n = KNOWN_N * (1 + deviation), ABSOLUTE * KNOWN_N
        tension = Summary(mean_n, sd_n, mean_n - sd_n, mean_n, mean_n + sd_n)
        time = START + timedelta(days=30 * n)
        tests.append((f"c{n}", time, tension, REPEATABILITY * KNOWN_N, KNOWN_N))
    return chart_control(control(), tests)


def test_chart_control_first_by_zeta() -> None:
    limit = 3 * math.hypot(ABSOLUTE, KNOWN_SD_N / KNOWN_N)
    (within,) = charted(0.99 * limit).points
    (out,) = charted(1.01 * limit).points

    assert within.limit == pytest.approx(limit)
    assert within.centre == 0.0
    assert not within.is_out
    assert out.is_out


def test_chart_control_learns_its_bias() -> None:
    bias = 0.03
    points = charted(*[bias] * 10, bias + 0.008).points

    assert points[9].centre == pytest.approx(bias, rel=0.01)
    # Of ten earlier tests the mean is known to a tenth of the variance of one.
    assert points[10].limit == pytest.approx(3 * REPEATS * math.sqrt(1 + 1 / 10), rel=0.01)
    assert points[10].is_out


def test_chart_control_leaves_out_outliers() -> None:
    with_one, without = charted(0.0, 0.05, 0.001), charted(0.0, 0.001)

    assert with_one.points[1].is_out
    assert with_one.points[2].centre == without.points[1].centre


def test_chart_control_out_if_unknown() -> None:
    assert charted(math.nan).points[0].is_out


def test_chart_control_false_alarms_rare() -> None:
    rng, out = np.random.default_rng(63), 0
    systematic = math.sqrt(ABSOLUTE**2 - REPEATS**2 + (KNOWN_SD_N / KNOWN_N) ** 2)
    for _ in range(500):
        bias = systematic * rng.normal()
        out += sum(each.is_out for each in charted(*(bias + REPEATS * rng.normal(size=8))).points)

    # 4000 tests within three standard deviations: 0.0027 of them are beyond by chance.
    assert out <= 4000 * 0.0027 + 3 * math.sqrt(4000 * 0.0027)


@pytest.mark.parametrize(("days", "name"), [(0.5, "c1"), (-0.5, "c1"), (2.0, None)])
def test_out_near_time(days: float, name: str | None) -> None:
    chart = charted(0.0, 0.2)

    found = chart.out_near(START + timedelta(days=30 + days), 1.0)

    assert (found and found.test) == name
