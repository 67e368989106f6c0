"""Errors that repeat: what their loads say against the same errors made in full."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.gap.hypotheses.contract import Design, Hypothesis, Observations
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.repeated_errors import (
    STRETCHES,
    ShapeScaling,
    section_loads,
    section_ways,
    sensor_loads,
)
from shm.inference.problem.systematic_errors import errors_of_sensors, felt_by, loads_of_ends
from shm.models.hanger import Zone, solve
from shm.values import AddedMass, FloatArray
from tests.helpers.gap_campaigns import HANGER, problem_of, simulated

USUAL = HANGER.scatter
PLAN: dict[str, Any] = {"modes": 5, "as_made": False, "shape_sd": 1e-3, "seed": 4}


@pytest.fixture(scope="module")
def problem() -> GapProblem:
    return problem_of(simulated(**PLAN))


@pytest.fixture(scope="module")
def value(problem: GapProblem) -> FloatArray:
    """Return the measured components of shapes."""
    return problem.value[problem.design.frequencies :]


def _changed(problem: GapProblem, raw: FloatArray) -> FloatArray:
    """Return the change of the shapes, scaled, where `raw` is measured in place of them."""
    scaled = ShapeScaling.measured(problem.observations).scaled(raw[None])[0]
    return np.asarray(scaled - problem.value[problem.design.frequencies :])


@pytest.mark.parametrize("error", ["gain", "turn"])
def test_a_sensor_changes_what_its_load_says(
    problem: GapProblem, value: FloatArray, error: str
) -> None:
    """Of one channel's gain, or of a sensor that is turned."""
    design, other = problem.design, value.reshape(-1, 2)[:, ::-1].ravel()
    transverse = design.shape_component == 0
    own = design.shape_place == 2
    raw = {
        "gain": value * np.where((design.shape_place == 1) & transverse, 1 + USUAL.sensor_gain, 1),
        "turn": value + np.where(transverse, 1.0, -1.0) * USUAL.sensor_turn * own * other,
    }[error]
    assert _nearest(problem.repeated.sensors, _changed(problem, raw)) < 0.02


def test_axes_that_hear_each_other_vary_each_on_its_own(
    problem: GapProblem, value: FloatArray
) -> None:
    """Turn and cross-axis sensitivity together: the axes' own variances, correlated by a turn."""
    design = problem.design
    loads = {
        kind: problem.repeated.sensors[:, k]
        for k, (kind, place, _) in enumerate(problem.repeated.sensor_errors)
        if place == 2
    }
    other = value.reshape(-1, 2)[:, ::-1].ravel() * (design.shape_place == 2)
    for axis in (0, 1):
        heard = _changed(problem, value + 1e-3 * other * (design.shape_component == axis))
        both = 1e-3 * (loads["cross"] / USUAL.sensor_cross_mean) / 2
        both += 1e-3 * (1, -1)[axis] * (loads["turn"] / USUAL.sensor_turn) / 2
        assert np.linalg.norm(heard - both) < 0.02 * np.linalg.norm(heard)
    variance = USUAL.sensor_turn**2 + USUAL.sensor_cross_mean**2
    turn = np.radians(USUAL.sensor_turn_deg)
    assert variance == pytest.approx(turn**2 + USUAL.sensor_cross_axis**2)


def test_a_sensor_elsewhere_changes_what_its_load_says(
    problem: GapProblem, value: FloatArray
) -> None:
    """The shapes of the baseline there, against those where it should be."""
    design = problem.design
    moved = (*design.places_m, design.places_m[2] + USUAL.sensor_place_m)
    place = np.where(design.shape_place == 2, len(design.places_m), design.shape_place)
    here, there = (
        problem.predict(Hypothesis(), problem.near, each)[0, design.frequencies :]
        for each in (
            replace(design, places_m=moved),
            replace(design, places_m=moved, shape_place=place),
        )
    )
    agrees = np.bincount(design.shape_mode, here * value) > 0
    change = np.where(agrees, 1.0, -1.0)[design.shape_mode] * (there - here)
    assert _nearest(problem.repeated.sensors, change) < 0.05


def test_a_shape_with_nodes_at_all_sensors_has_no_loads_of_places(problem: GapProblem) -> None:
    """A planned measurement may put its sensors there; what they see of a string is lost digits."""
    third = int(np.flatnonzero(problem.design.frequency_order == 3)[0])
    nodes = replace(
        problem.design,
        places_m=(HANGER.length_m / 3, 2 * HANGER.length_m / 3),
        shape_mode=np.full(4, third),
        shape_place=np.array([0, 0, 1, 1]),
        shape_component=np.array([0, 1, 0, 1]),
    )

    def string(design: Design) -> FloatArray:
        x_m = np.array(design.places_m)[design.shape_place]
        shape = np.where(design.shape_component == 0, np.sin(3 * np.pi * x_m / HANGER.length_m), 0)
        scaled = ShapeScaling.of(design, HANGER.length_m).scaled(shape[None])[0]
        return np.concatenate([np.zeros(design.frequencies), scaled])

    seen = string(nodes)
    loads, _ = sensor_loads(Observations(nodes, seen, np.ones_like(seen)), string, HANGER)
    assert np.abs(loads).max() < 0.1


def _nearest(loads: FloatArray, change: FloatArray) -> float:
    """How far the likest load is from a change, as a share of it; its sign is nobody's."""
    signed = np.column_stack([loads, -loads])
    return float(np.linalg.norm(signed - change[:, None], axis=0).min() / np.linalg.norm(change))


def test_loads_of_sensors_do_not_change_a_shapes_length(
    problem: GapProblem, value: FloatArray
) -> None:
    scaling = ShapeScaling.measured(problem.observations)
    along = scaling.weight * value
    loads = problem.repeated.sensors[:, : len(problem.repeated.sensor_errors)]
    for column in loads.T:
        assert np.abs(np.bincount(scaling.shape, along * column)).max() < 1e-12


def test_a_thicker_middle_shifts_frequencies_as_the_sections_loads_say(
    problem: GapProblem,
) -> None:
    """A cosine of the section is solved in full; its shift lies in what the loads span.

    And by a size that fits the prior: a cosine of 0.1 % rms is about one standard deviation.
    """
    plain = problem.model.physical(problem.described.theta(problem.near))
    edges_m = np.linspace(0, HANGER.length_m, 25)
    middles = (edges_m[1:] + edges_m[:-1]) / 2 / HANGER.length_m
    thick = 1 + 1e-3 * np.sqrt(2) * np.cos(2 * np.pi * middles)
    zones = tuple(
        Zone(np.array([a]), np.array([b]), np.array([f**2]), np.array([f]))
        for a, b, f in zip(edges_m[:-1], edges_m[1:], thick, strict=True)
    )
    bars = (replace(plain, zones=(*plain.zones, *more)) for more in (zones, ()))
    solved = [solve(bar, 5, np.empty(0), shapes=False).frequency_hz[0] for bar in bars]
    shift = np.log(solved[0] / solved[1])[problem.design.frequency_plane][
        np.arange(problem.design.frequencies), problem.design.frequency_order - 1
    ]
    loads = problem.repeated.section
    ways = np.linalg.lstsq(loads, shift, rcond=None)[0]
    np.testing.assert_allclose(loads @ ways, shift, atol=2e-6)
    assert 0.5 < np.linalg.norm(ways) < 3.0


def test_the_section_varies_about_its_mean_by_what_the_description_says() -> None:
    """In fewer ways where its reach is longer: a bar alike over metres has hardly a freedom."""
    for length_m in (3.0, 12.0):
        ways = section_ways(length_m, 0.001, DEFAULTS.section_reach_m.value)
        assert np.sqrt(np.mean((ways**2).sum(axis=1))) == pytest.approx(0.001, rel=1e-3)
        np.testing.assert_allclose(ways.mean(axis=0), 0.0, atol=1e-12)
    counts = [section_ways(12.0, 0.001, reach_m).shape[1] for reach_m in (0.5, 2.0, 8.0)]
    assert counts[0] > counts[1] > counts[2] >= 1


def test_what_one_plane_gains_by_a_section_that_is_not_round_the_other_loses(
    problem: GapProblem,
) -> None:
    """The load is the change by a bending stiffness that is one standard deviation larger."""
    design, sd = problem.design, DEFAULTS.out_of_round_sd.value
    theta = problem.described.theta(problem.near)
    plain = problem.model.physical(theta)
    whole = Zone(np.zeros(1), np.array([HANGER.length_m]), np.array([1 + sd]), np.ones(1))
    bars = (replace(plain, zones=(*plain.zones, *more)) for more in ((whole,), ()))
    solved = [np.log(solve(bar, 5, np.empty(0), shapes=False).frequency_hz[0]) for bar in bars]
    stiffer = (solved[0] - solved[1])[design.frequency_plane, design.frequency_order - 1]
    copies = problem.model.physical(np.repeat(theta, STRETCHES + 2, axis=0))
    found = section_loads(design, copies, HANGER)[:, -1]
    expected = np.where(design.frequency_plane == 0, stiffer, -stiffer)
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_a_round_bar_of_one_section_has_no_loads_but_those_of_sensors_and_supports() -> None:
    hanger = replace(
        HANGER,
        scatter=replace(HANGER.scatter, along=0.0),
        assumptions=HANGER.assumptions.with_numbers(out_of_round_sd=0.0),
    )
    found = problem_of(simulated(**PLAN), hanger=hanger)
    design = found.design
    theta = found.described.theta(found.near)
    bars = found.model.physical(np.repeat(theta, STRETCHES + 2, axis=0))
    assert not section_loads(design, bars, hanger).any()
    plane, order = design.frequency_plane, design.frequency_order
    frequency_hz = np.exp(found.observations.value[: design.frequencies])
    ends = found.model.end_waves(theta, frequency_hz[None], plane)
    places_m = tuple(design.places_m[place] for place in np.unique(design.shape_place))
    _, sensors = errors_of_sensors(hanger, felt_by(ends[0]), places_m)
    own = np.hstack([sensors, loads_of_ends(ends, (0.0, 0.0), plane, order)])
    np.testing.assert_allclose(found.repeated.frequency, own @ own.T, rtol=0.1, atol=1e-12)


def test_an_unstated_radius_of_a_known_mass_is_an_error_of_its_test() -> None:
    """One standard deviation more and less makes what its load says, in that test alone."""
    tests, row = simulated(**PLAN), DEFAULTS.added_mass_radius_m

    def problem_with(radius_m: float | None) -> GapProblem:
        clamp = AddedMass(25.0, 3.4, radius_of_gyration_m=radius_m)
        return problem_of([*tests, replace(tests[0], id="laden", added_mass=clamp)])

    unstated = problem_with(None)
    own = unstated.design.frequency_test == len(tests)
    near = unstated.near
    predicted = [
        problem_with(row.value + side * row.sd).predict(Hypothesis(), near)[0, : len(own)]
        for side in (-1, 1)
    ]
    (load,) = unstated.repeated.masses.T
    np.testing.assert_allclose(load, (predicted[1] - predicted[0]) / 2, rtol=1e-6, atol=1e-12)
    assert np.abs(load[own]).max() > 1e-5
    assert not load[~own].any()
    assert problem_with(0.1).repeated.masses.shape[1] == 0
    count = len(own)
    with_load = unstated.repeated.loads[:count] @ unstated.repeated.loads[:count].T
    np.testing.assert_allclose(unstated.repeated.frequency, with_load)
