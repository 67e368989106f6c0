"""Errors that tests share, to first order, against the general model and against random draws."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.gap.hypotheses.repeated_errors import STRETCHES, section_loads
from shm.inference.problem.systematic_errors import (
    errors_of_sensors,
    felt_by,
    loads_of_ends,
    loads_of_section,
    mean_of_ends,
)
from shm.models.classes.end_effects import EndWaves
from shm.models.hanger import PhysicalHanger, PointMass
from shm.values import FloatArray, Hanger, Scatter
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import frequencies_hz

ORDERS = np.arange(1, 7)
GIVE, SENSOR = DEFAULTS.support_compliance_m_n, DEFAULTS.accelerometer_mass_kg
SLIM = replace(
    HANGER_3,
    area_m2=HANGER_3.area_m2 / 25,
    second_moment_m4=HANGER_3.second_moment_m4 / 625,
    mass_per_length_kg_m=HANGER_3.mass_per_length_kg_m / 25,
    nominal_tension_n=60e3,
)
"""A 26 mm rod, on which 50 g matter."""


def pinned(hanger: Hanger) -> PhysicalHanger:
    one = np.ones(1)
    bar = PhysicalHanger.clamped(hanger, hanger.nominal_tension_n * one)
    compliance = np.zeros((1, 2, 2, 2))
    compliance[..., [0, 1], [0, 1]] = np.inf
    return replace(bar, rotational_compliance_rad_n_m=compliance)


def lowered(hanger: Hanger, **changed: object) -> FloatArray:
    """ln of frequencies (orders,) over the bare bar's."""
    bars = replace(pinned(hanger), **changed), pinned(hanger)  # type: ignore[arg-type]
    changed_hz, bare_hz = (frequencies_hz(each, len(ORDERS))[0, 0] for each in bars)
    return np.asarray(np.log(changed_hz / bare_hz))


def ends(hanger: Hanger) -> tuple[EndWaves, EndWaves]:
    """Of the pinned bar, of one plane."""
    bare = frequencies_hz(pinned(hanger), len(ORDERS))[0, :1]
    sets = (hanger.nominal_tension_n, hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m)
    one = EndWaves.of(bare, *(np.asarray(each) for each in (*sets, hanger.length_m, 0.0)))
    return one, one


def found(hanger: Hanger, places_m: tuple[float, ...] = ()) -> tuple[FloatArray, FloatArray]:
    """Mean and loads of one plane, of sensors and section."""
    mean, loads = errors_of_sensors(hanger, felt_by(ends(hanger)[0]), places_m)
    return mean, np.hstack([loads, loads_of_section(hanger, ORDERS)])


@pytest.mark.parametrize("x_m", [0.9, 1.7, 3.1])
def test_a_sensor_where_it_is_known_to_sit_lowers_each_mode_as_the_general_model_does(
    x_m: float,
) -> None:
    """Its mean mass, and by one standard deviation of that what the load says."""
    mean, loads = found(SLIM, (x_m,))
    for kg, size in ((SENSOR.value, mean), (SENSOR.sd, loads[:, 0])):
        mass = PointMass(np.array([x_m]), np.array([kg]))
        shift = lowered(SLIM, masses=(mass,))
        np.testing.assert_allclose(size, shift, atol=0.05 * np.abs(shift).max())
        assert np.abs(shift).max() > 2e-4


def sensors_anywhere(hanger: Hanger, draws: int = 40_000) -> FloatArray:
    """What masses as uncertain, where a person reaches, lower modes by (draws, orders)."""
    rng = np.random.default_rng(1)
    x_m = rng.uniform(0.8, 2.5, (draws, 1))
    kg = SENSOR.value + SENSOR.sd * rng.standard_normal((draws, 1))
    whole_kg = hanger.mass_per_length_kg_m * hanger.length_m
    return np.asarray(-kg / whole_kg * np.sin(np.pi * ORDERS * x_m / hanger.length_m) ** 2)


def test_a_sensor_that_may_sit_anywhere_in_reach_has_the_moments_of_draws() -> None:
    stiff = replace(SLIM, scatter=Scatter(along=0.0))
    mean, loads = found(stiff)
    drawn = sensors_anywhere(stiff)
    np.testing.assert_allclose(mean, drawn.mean(axis=0), atol=0.02 * np.abs(drawn).mean())
    expected = np.cov(drawn.T)
    np.testing.assert_allclose(loads @ loads.T, expected, atol=0.03 * expected.max())


@pytest.mark.parametrize("hanger", [HANGER_3, SLIM], ids=["thick", "slim"])
def test_supports_that_give_way_lower_each_mode_as_the_general_model_does(hanger: Hanger) -> None:
    mean = mean_of_ends(ends(hanger), (0.0, 0.0))[0]
    shift = lowered(hanger, translational_compliance_m_n=np.full((1, 2, 2), GIVE.value))
    np.testing.assert_allclose(mean, shift, rtol=0.05, atol=1e-9)
    assert np.abs(mean).max() > 1e-5


def test_planes_share_half_of_what_is_unsure_of_an_end() -> None:
    order = np.array([0, 0])
    one = replace(
        ends(HANGER_3)[0],
        **{
            name: getattr(ends(HANGER_3)[0], name)[:, order]
            for name in ("q", "p", "sin", "cos", "clamped")
        },
    )
    both, orders = np.array([0, 1]), np.array([1, 1])
    for fittings_m in ((0.0, 0.0), (0.3, 0.3)):
        loads = loads_of_ends((one, one), fittings_m, both, orders)
        covariance = loads @ loads.T
        np.testing.assert_allclose(covariance[0, 1] / covariance[0, 0], 0.5, rtol=0.05)
    give = one.give()[0, 0]
    bare = loads_of_ends((one, one), (0.0, 0.0), both, orders)
    np.testing.assert_allclose((bare @ bare.T)[0, 0], 2 * (GIVE.sd * give) ** 2, rtol=0.05)


def test_a_section_that_wanders_moves_modes_as_much_as_the_general_models() -> None:
    """Of a clamped bar, low orders to a half; of a pinned one as of a string it is twice that."""
    rows, modes = STRETCHES + 2, np.repeat(ORDERS[None], 2, axis=0)
    plane = np.repeat([[0], [1]], len(ORDERS), axis=1)
    design = SimpleNamespace(frequency_plane=plane.ravel(), frequency_order=modes.ravel())
    clamped = PhysicalHanger.clamped(HANGER_3, np.full(rows, HANGER_3.nominal_tension_n))
    loads = section_loads(design, clamped, HANGER_3)  # type: ignore[arg-type]
    exact = loads[: len(ORDERS), :-1]  # the last is that of a section that is not round
    own, none = (
        found(replace(HANGER_3, scatter=Scatter(along=along)), (0.0,))[1]
        for along in (HANGER_3.scatter.along, 0.0)
    )
    size = np.sqrt((own**2).sum(axis=1) - (none**2).sum(axis=1))
    ratio = size / np.sqrt((exact**2).sum(axis=1))
    assert np.all((ratio[:4] > 0.9) & (ratio[:4] < 1.5))
    assert np.all(np.diff(size) < 0)
