"""The data vector: what of the tests is used, and how it is scaled."""

from __future__ import annotations

import numpy as np
import pytest

from shm.errors import BadInput
from shm.gap.observations import observed, survey_of
from shm.values import NAN, AddedMass, ModalTest, Mode, ShapePoint
from tests.helpers.hangers import HANGER_3


def _test(name: str = "t1", *modes: Mode, **conditions: object) -> ModalTest:
    own = modes or (_mode(1), _mode(2))
    return ModalTest(name, own, **conditions)  # type: ignore[arg-type]


def _mode(order: int, frequency_hz: float = 0.0, sd_hz: float = 0.01, *shape: ShapePoint) -> Mode:
    return Mode("transverse", order, frequency_hz or 6.0 * order, sd_hz, shape=shape)


def test_frequencies_are_logarithms_with_fractional_standard_deviations() -> None:
    found = observed([_test("t1", _mode(1, 5.0, 0.01), _mode(2, 12.0, NAN))], HANGER_3)
    np.testing.assert_allclose(found.value, np.log([5.0, 12.0]))
    np.testing.assert_allclose(found.sd, [0.002, np.nan])


def test_a_standard_deviation_of_zero_is_an_unknown_one() -> None:
    assert np.isnan(observed([_test("t1", _mode(1, 5.0, 0.0), _mode(2))], HANGER_3).sd[0])


def test_temperatures_count_from_the_mean_of_those_known_and_unknown_conditions_are_neutral() -> (
    None
):
    tests = [
        _test("a", temperature_c=0.0, amplitude=2.0),
        _test("b", temperature_c=10.0),
        _test("c"),
    ]
    conditions = observed(tests, HANGER_3).design.conditions
    assert [each.temperature_shift_k for each in conditions] == [-5.0, 5.0, 0.0]
    assert [each.amplitude for each in conditions] == [2.0, 1.0, 1.0]


def test_a_shape_has_unit_length_and_its_standard_deviations_shrink_with_it() -> None:
    shape = (ShapePoint(2.0, 3.0, 0.0, 0.1), ShapePoint(5.0, 4.0, NAN, 0.1))
    found = observed([_test("t1", _mode(1, 5.0, 0.01, *shape), _mode(2))], HANGER_3)
    np.testing.assert_allclose(found.value[2:], [0.6, 0.0, 0.8])
    np.testing.assert_allclose(found.sd[2:], 0.02)
    assert found.design.shape_component.tolist() == [0, 1, 0]
    assert found.design.shape_place.tolist() == [0, 0, 1]


def test_an_uncertain_component_hardly_counts_in_the_length() -> None:
    """With sd of 1 beside 0.001 the length is that of the certain ones times a known factor."""
    sure = [ShapePoint(x, 1.0, sd=0.001) for x in (2.0, 4.0, 6.0)]
    for wild in (0.5, 5.0):
        shape = (*sure, ShapePoint(8.0, wild, sd=1.0))
        found = observed([_test("t1", _mode(1, 5.0, 0.01, *shape), _mode(2))], HANGER_3)
        np.testing.assert_allclose(found.value[2:5], np.sqrt(0.25), rtol=1e-4)


def test_points_without_a_standard_deviation_or_value_are_left_out_and_nothing_is_nan() -> None:
    shape = (ShapePoint(2.0, NAN, sd=0.1), ShapePoint(4.0, 1.0), ShapePoint(6.0, 0.5, 0.1, 0.1))
    found = observed([_test("t1", _mode(1, 5.0, 0.01, *shape), _mode(2))], HANGER_3)
    assert found.design.places_m == (6.0,)
    assert np.isfinite(found.value).all()


def test_places_within_a_millimetre_are_one() -> None:
    one = (ShapePoint(2.0, 1.0, sd=0.1), ShapePoint(5.0, 1.0, sd=0.1))
    other = (ShapePoint(2.0005, 1.0, sd=0.1), ShapePoint(5.0, 1.0, sd=0.1))
    tests = [_test("t1", _mode(1, 5.0, 0.01, *one), _mode(2, 12.0, 0.01, *other))]
    assert observed(tests, HANGER_3).design.places_m == (2.0, 5.0)


def test_the_survey_says_what_is_measured_and_varied() -> None:
    mass = AddedMass(25.0, 3.6)
    shape = (ShapePoint(2.0, 1.0, 0.0, 0.1), ShapePoint(5.0, 1.0, 0.0, 0.1))
    tests = [
        _test("t1", _mode(1, 5.0, 0.01, *shape), temperature_c=20.0, amplitude=1.0),
        _test("t2", temperature_c=5.0, amplitude=1.0, added_mass=mass),
    ]
    survey = survey_of(tests)
    assert survey.tests == ("t1", "t2")
    assert survey.planes == ("transverse",)
    assert survey.biaxial
    assert survey.temperatures_c == (5.0, 20.0)
    assert survey.amplitudes == (1.0,)
    assert survey.added_masses == (mass,)


@pytest.mark.parametrize(
    ("modes", "words"),
    [
        ((_mode(1, -3.0), _mode(2)), "no frequency"),
        ((_mode(1, np.nan),), "nan Hz is no frequency"),
        ((_mode(1, np.inf),), "inf Hz is no frequency"),
        ((_mode(0, 5.0), _mode(2)), "count from 1"),
    ],
)
def test_what_cannot_be_is_refused_in_words(modes: tuple[Mode, ...], words: str) -> None:
    with pytest.raises(BadInput, match=words) as raised:
        observed([ModalTest("t1", modes)], HANGER_3)
    assert raised.value.remedy
