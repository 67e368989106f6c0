"""What is watched of a hanger, and the coordinates of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shm.models import described
from shm.values import TENSION, Hanger, Posterior, Turnbuckle, WatchedQuantity
from shm.watch.quantities import (
    MeasuredMode,
    common_stiffness,
    coordinate_of,
    shift_of,
    value_at,
    watched_quantities,
)
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import posterior

SPRUNG = (1.1, 0.97, 7.2, 7.6, 8.6, 6.6)
TRANSVERSE: list[MeasuredMode] = [("transverse", order) for order in range(1, 7)]
LONGITUDINAL: list[MeasuredMode] = [("longitudinal", order) for order in range(1, 7)]
BOTH = TRANSVERSE + LONGITUDINAL
TRANSVERSE_ENDS, LONGITUDINAL_ENDS = "transverse_end_stiffness", "longitudinal_end_stiffness"


def baseline(
    theta: Sequence[float], model: str = "beam2", spread: float = 0.05, hanger: Hanger = HANGER_3
) -> Posterior:
    """A posterior about `theta`, with two percent more tension on the mean than most probably."""
    made, rng = described(model, hanger), np.random.default_rng(1)
    samples = np.tile(np.array(theta), (500, 1)) + spread * rng.standard_normal((500, len(theta)))
    samples[:, 0] = 1.02 * theta[0] * (1 + 0.01 * rng.standard_normal(500))
    samples = np.clip(samples, made.prior.lower, made.prior.upper)
    return replace(
        posterior(theta, model, hanger),
        names=(*made.parameter_names, "sigma"),
        samples=np.column_stack([samples, np.full(500, 0.003)]),
        log_likelihood=np.zeros(500),
        most_probable=np.append(theta, 0.003),
    )


def by_name(quantities: Sequence[WatchedQuantity]) -> dict[str, WatchedQuantity]:
    return {each.name: each for each in quantities}


def test_of_clamped_ends_the_tension_alone_is_watched() -> None:
    (tension,) = watched_quantities(baseline((1.1, 0.97), "beam1"), HANGER_3, BOTH)
    assert (tension.name, tension.step_sd, tension.end, tension.plane) == (
        TENSION,
        0.05,
        None,
        None,
    )


@pytest.mark.parametrize(
    ("theta", "model", "unit"),
    [
        ((1.1, 0.97, 8.0, 8.0, 8.0, 8.0), "beam2", "N m/rad"),
        pytest.param((1.1, *[8.0] * 4), "solid2", "N/m", marks=pytest.mark.slow),
    ],
)
def test_watched_quantities_units(theta: tuple[float, ...], model: str, unit: str) -> None:
    tension, *springs = watched_quantities(baseline(theta, model), HANGER_3, BOTH)
    assert tension.unit == "N"
    assert {each.unit for each in springs} == {unit}


def test_the_tension_comes_first_and_then_the_ends_of_each_plane_in_one() -> None:
    found = watched_quantities(baseline(SPRUNG), HANGER_3, BOTH)
    assert [(each.name, each.plane, each.parameters) for each in found] == [
        ("tension", None, ("theta_F",)),
        (TRANSVERSE_ENDS, "transverse", ("log10_k1", "log10_k3")),
        (LONGITUDINAL_ENDS, "longitudinal", ("log10_k2", "log10_k4")),
    ]


def test_the_stiffness_of_two_ends_is_that_of_two_springs_alike() -> None:
    found = by_name(watched_quantities(baseline(SPRUNG), HANGER_3, BOTH))[TRANSVERSE_ENDS]
    assert 10**found.baseline == pytest.approx(2 / (10**-7.2 + 10**-8.6))
    assert common_stiffness(np.array([[7.0, 7.0], [12.0, 7.0]])) == pytest.approx(
        [7.0, 7.0 + np.log10(2)], abs=1e-4
    )


def test_the_tension_people_see_is_the_mean_and_its_coordinate_the_log_of_the_ratio() -> None:
    known = baseline(SPRUNG)
    tension = watched_quantities(known, HANGER_3, BOTH)[0]
    assert tension.baseline == pytest.approx(known.tension_n.mean())
    np.testing.assert_allclose(tension.values, tension.baseline * np.exp(tension.coordinates))
    assert 0.0 in tension.coordinates
    assert value_at(tension, np.log(0.9)) == pytest.approx(0.9 * tension.baseline)
    assert shift_of(tension, np.log(0.9)) == pytest.approx(-0.1)
    assert coordinate_of(tension, 0.9 * tension.baseline) == pytest.approx(np.log(0.9))


def test_a_springs_coordinate_is_the_change_of_the_mean_log_frequency() -> None:
    springs = by_name(watched_quantities(baseline(SPRUNG), HANGER_3, BOTH))[TRANSVERSE_ENDS]
    model, theta = described("beam2", HANGER_3), np.tile(SPRUNG, (3, 1))
    decades = np.array([0.0, -0.75, 1.7])
    theta[:, [2, 4]] += decades[:, None]
    mean = np.log(model.frequencies_hz(theta, 6)).mean(axis=(1, 2))
    assert coordinate_of(springs, springs.baseline) == 0.0
    for row in (1, 2):
        coordinate = coordinate_of(springs, springs.baseline + decades[row])
        assert coordinate == pytest.approx(mean[row] - mean[0], rel=0.01)


def test_values_and_coordinates_rise_strictly_through_the_baseline() -> None:
    for theta in (SPRUNG, (1.0, 1.0, 12.0, 5.0, 11.9, 11.98)):
        for each in watched_quantities(baseline(theta), HANGER_3, BOTH):
            assert np.all(np.diff(each.coordinates) > 0)
            assert np.all(np.diff(each.values) > 0)
            assert value_at(each, 0.0) == pytest.approx(each.baseline, rel=1e-12)


def test_a_value_stops_at_the_end_of_its_table() -> None:
    found = by_name(watched_quantities(baseline(SPRUNG), HANGER_3, BOTH))
    assert value_at(found[TRANSVERSE_ENDS], 1.0) == found[TRANSVERSE_ENDS].values[-1]
    assert value_at(found[TRANSVERSE_ENDS], -1.0) == 5.0
    nominal_n = HANGER_3.nominal_tension_n * 1.02
    assert value_at(found["tension"], 9.0) == pytest.approx(5 * nominal_n, rel=0.01)
    at_rest_n = value_at(found["tension"], 0.0)
    assert value_at(found["tension"], -9.0) == pytest.approx(0.02 * at_rest_n, rel=0.01)  # slack


def test_many_coordinates_give_as_many_values_and_shifts() -> None:
    springs = by_name(watched_quantities(baseline(SPRUNG), HANGER_3, BOTH))[TRANSVERSE_ENDS]
    values = springs.baseline + np.array([-0.3, 0.0, 0.3])
    coordinates = np.array([coordinate_of(springs, value) for value in values])
    np.testing.assert_allclose(value_at(springs, coordinates), values)
    np.testing.assert_allclose(shift_of(springs, coordinates), [-0.3, 0.0, 0.3], atol=1e-9)


def test_a_step_of_a_spring_is_what_a_third_of_a_decade_does() -> None:
    known = baseline(SPRUNG, spread=0.0)
    springs = by_name(watched_quantities(known, HANGER_3, BOTH))[TRANSVERSE_ENDS]
    down, up = (coordinate_of(springs, springs.baseline + shift) for shift in (-0.3, 0.3))
    assert springs.step_sd == pytest.approx(max(-down, up), rel=1e-9)


def test_ends_that_may_be_softer_than_they_most_probably_are_may_change_visibly() -> None:
    known = baseline((1.1, 0.97, 11.9, 7.6, 11.9, 6.6))
    sure = by_name(watched_quantities(known, HANGER_3, BOTH))[TRANSVERSE_ENDS]
    samples = known.samples.copy()
    samples[:, 4] = np.linspace(8.0, 12.0, len(samples))
    unsure = by_name(watched_quantities(replace(known, samples=samples), HANGER_3, BOTH))
    assert sure.step_sd < 1e-6
    assert unsure[TRANSVERSE_ENDS].step_sd > 1e-4


def test_springs_of_a_plane_that_is_not_measured_are_not_watched() -> None:
    found = watched_quantities(baseline(SPRUNG), HANGER_3, TRANSVERSE)
    assert [each.name for each in found] == [TENSION, TRANSVERSE_ENDS]


def test_ends_that_no_frequency_tells_apart_are_not_named() -> None:
    found = watched_quantities(baseline(SPRUNG), HANGER_3, BOTH)
    assert [each.end for each in found] == [None] * 3


def test_ends_that_a_turnbuckle_tells_apart_are_watched_each_by_its_name() -> None:
    hanger = replace(HANGER_3, turnbuckles=(Turnbuckle(1.5, 0.6, 120.0, 6e6),))
    found = watched_quantities(baseline(SPRUNG, hanger=hanger), hanger, BOTH)
    assert [(each.name, each.end, each.plane, each.parameters) for each in found[1:]] == [
        ("log10_k1", "deck", "transverse", ("log10_k1",)),
        ("log10_k2", "deck", "longitudinal", ("log10_k2",)),
        ("log10_k3", "arch", "transverse", ("log10_k3",)),
        ("log10_k4", "arch", "longitudinal", ("log10_k4",)),
    ]
    assert [each.baseline for each in found[1:]] == list(SPRUNG[2:])


def test_ends_that_a_turnbuckle_tells_apart_stay_apart_where_both_are_clamped() -> None:
    hanger = replace(HANGER_3, turnbuckles=(Turnbuckle(1.5, 0.6, 120.0, 6e6),))
    clamped = baseline((1.1, 0.97, 11.9, 11.8, 11.9, 11.8), hanger=hanger)
    found = watched_quantities(clamped, hanger, BOTH)
    assert [each.end for each in found] == [None, "deck", "deck", "arch", "arch"]


def test_a_symmetrical_effect_leaves_the_ends_alike_and_is_not_watched_itself() -> None:
    name = "beam2+bending_stiffness@everywhere"
    names = described(name, HANGER_3).parameter_names
    values = dict.fromkeys(names, 0.0) | {"theta_F": 1.1, "log10_k1": 7.2, "log10_k2": 7.6}
    values |= {"log10_k3": 8.6, "log10_k4": 6.6, "stiffness_change": -0.1}
    theta = [values[each] for each in names]
    found = watched_quantities(baseline(theta, name, spread=0.001), HANGER_3, BOTH)
    assert [each.name for each in found] == [TENSION, TRANSVERSE_ENDS, LONGITUDINAL_ENDS]
    assert [each.end for each in found] == [None] * 3


def test_a_description_whose_nominal_tension_was_corrected_keeps_the_tension() -> None:
    known = baseline(SPRUNG)
    corrected = replace(HANGER_3, nominal_tension_n=2 * HANGER_3.nominal_tension_n)
    before, after = (watched_quantities(known, each, BOTH) for each in (HANGER_3, corrected))
    assert after[0].baseline == pytest.approx(before[0].baseline, rel=1e-12)
    for one, other in zip(before[1:], after[1:], strict=True):
        np.testing.assert_allclose(one.coordinates, other.coordinates, atol=1e-9)
