"""Bad input of a diagnosis is said in words, with what it does to the answer."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from shm.errors import BadInput
from shm.gap.data_checks import usable
from shm.values import NAN, AddedMass, Hanger, ModalTest, Mode, Plane, Scatter, ShapePoint

HANGER = Hanger(3, 12.0, 200e9, 0.01327, 1.402e-5, 103.5, 711e3)
FREQUENCIES = (5.6, 13.5, 24.6, 39.1, 57.1, 78.6)
AGAIN = tuple(1.00001 * hz for hz in FREQUENCIES)  # no two measurements agree to the last digit


def _test(
    name: str = "t1", frequencies: tuple[float, ...] = FREQUENCIES, sd: float = 1e-4
) -> ModalTest:
    planes: tuple[Plane, Plane] = ("transverse", "longitudinal")
    modes = tuple(
        Mode(plane, order, frequency, sd * frequency)
        for plane in planes
        for order, frequency in enumerate(frequencies, 1)
    )
    return ModalTest(name, modes, hanger=3, temperature_c=10.0, amplitude=1.0)


def test_good_tests_call_for_no_remark_and_lose_no_mode() -> None:
    tests = (_test("t1"), _test("t2", AGAIN))
    found = usable(tests, HANGER)
    assert found.tests == tests
    assert found.remarks == ()


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("rad/s", 2 * math.pi), ("rpm", 60.0), ("kHz", 1e-3), ("s (periods)", None)],
)
def test_frequencies_in_another_unit_are_recognised(unit: str, factor: float | None) -> None:
    given = tuple(factor * hz if factor else 1 / hz for hz in FREQUENCIES)
    try:
        said = usable([_test("t1", given)], HANGER).remarks[0]
    except BadInput as refused:  # of periods, which fall as orders rise
        said = str(refused)
    assert f"look given in {unit}, not in Hz" in said
    for tension_n in (0.4 * 711e3, 2.5 * 711e3):
        assert not usable([_test()], replace(HANGER, nominal_tension_n=tension_n)).remarks


def test_copies_of_a_test_count_once() -> None:
    tests = [_test(f"t{number}") for number in range(6)]
    found = usable(tests, HANGER)
    assert found.tests == (tests[0],)
    assert "t5 (as t0)" in found.remarks[0]
    assert len(usable([tests[0], replace(tests[1], temperature_c=20.0)], HANGER).tests) == 2


def test_one_mode_only_is_said_with_what_it_does() -> None:
    only = replace(_test(), modes=_test().modes[:1])
    (remark,) = usable([only], HANGER).remarks
    assert "Only one mode is given (transverse 1): tension alone can follow" in remark
    assert "cause cannot" in remark


@pytest.mark.parametrize(
    ("hanger", "said"),
    [
        (replace(HANGER, nominal_tension_n=0.0), "the bar carries no tension that could follow"),
        (replace(HANGER, scatter=Scatter(tension=0.01)), "the tension is known to 1 %, so that a"),
    ],
)
def test_few_modes_of_a_bar_whose_tension_is_known_are_not_said_to_be_followed_by_it(
    hanger: Hanger, said: str
) -> None:
    only = replace(_test(), modes=_test().modes[:3])
    (remark,) = usable([only], hanger).remarks
    assert remark.startswith("Only 3 modes are given (transverse 1, transverse 2, transverse 3): ")
    assert said in remark
    assert "a gap can show, but most causes look alike" in remark
    assert "tension alone" not in remark


def test_one_mode_at_several_tensions_read_shows_a_gap_by_how_it_rises() -> None:
    one = replace(_test("t1"), modes=_test().modes[:1], tension_read_n=7e5, tension_read_sd_n=7e3)
    other = replace(one, id="t2", tension_read_n=8e5)
    (remark,) = usable([one, other], HANGER).remarks
    assert "a gap shows only where the frequencies do not change as the tensions" in remark
    assert "tension alone" not in remark
    again = replace(_test("t2", AGAIN), modes=_test("t2", AGAIN).modes[:1], tension_read_n=7e5)
    few, unused = usable([one, again], HANGER).remarks
    assert "tension alone can follow" in few
    assert unused.startswith("The tension read, 700 kN, is not used")


def test_an_irregular_mode_is_used_and_said() -> None:
    regular = _test()
    test = replace(regular, modes=(replace(regular.modes[0], irregular=True), *regular.modes[1:]))
    found = usable([test], HANGER)
    assert found.tests == (test,)
    (remark,) = found.remarks
    assert remark.startswith("Well off the beam that the other modes follow is transverse 1 of tes")
    assert "(5.6 Hz): the diagnosis takes it, `shm update` leaves it out" in remark
    other = _test("t2", AGAIN)
    other = replace(other, modes=(replace(other.modes[0], irregular=True), *other.modes[1:]))
    (remark,) = usable([test, other], HANGER).remarks
    assert "follow are transverse 1 of test t1 (5.6 Hz), transverse 1 of test t2" in remark


def test_frequencies_without_standard_deviation_are_said() -> None:
    remark, rounding = usable([_test(sd=NAN)], HANGER).remarks
    assert remark.startswith("No frequency has a standard deviation")
    assert "rounded to 0.1 Hz: errors of 0.52 % of the lowest" in rounding
    some = replace(_test(), modes=(*_test().modes[:6], *_test(sd=NAN).modes[6:]))
    remark, _ = usable([some], HANGER).remarks
    assert remark.startswith("6 of 12 frequencies have no standard deviation")
    remark, _ = usable([_test(sd=0.0)], HANGER).remarks
    assert remark.startswith("No frequency has a standard deviation (0 is none): how exact")


def test_modes_out_of_order_are_left_out_and_named() -> None:
    swapped = _test(frequencies=(5.6, 24.6, 13.5, 39.1, 57.1, 78.6))
    found = usable([swapped], HANGER)
    assert [(mode.plane, mode.order) for mode in found.tests[0].modes] == [
        (plane, order) for plane in ("transverse", "longitudinal") for order in (1, 4, 5, 6)
    ]
    assert (
        "Left out: test t1, transverse 3 (13.5 Hz) does not lie above transverse 2 (24.6 Hz)"
        in (found.remarks[0])
    )


def test_a_mode_given_twice_is_left_out() -> None:
    test = _test()
    doubled = replace(test, modes=(*test.modes, test.modes[0]))
    found = usable([doubled], HANGER)
    assert ("transverse", 1) not in [(mode.plane, mode.order) for mode in found.tests[0].modes]
    assert "given twice" in found.remarks[0]


def test_two_tests_that_contradict_each_other_are_named_with_the_worst_mode() -> None:
    other = _test("t2", tuple(f * 1.01 if f == 24.6 else f for f in FREQUENCIES))
    (remark,) = usable([_test("t1"), other], HANGER).remarks
    assert "Tests t1 and t2 contradict each other" in remark
    assert "transverse 3 differs by 1.00 %" in remark


def test_tests_under_other_conditions_may_differ() -> None:
    other = _test("t2", tuple(1.01 * f for f in FREQUENCIES))
    warmer, louder = replace(other, temperature_c=25.0), replace(other, amplitude=2.0)
    laden = replace(other, added_mass=AddedMass(25.0, 3.6))
    for changed in (warmer, louder, laden):
        assert usable([_test("t1"), changed], HANGER).remarks == ()


@pytest.mark.parametrize(
    "unknown",
    [{"temperature_c": NAN}, {"amplitude": NAN}, {"tension_read_n": 500e3}],
    ids=["temperature", "amplitude", "tension"],
)
@pytest.mark.parametrize("first", [True, False])
def test_usable_unknown_conditions(unknown: dict[str, float], first: bool) -> None:
    """A test whose condition is unknown, next to one of which it is known, contradicts nothing."""
    tests = [_test("t1"), _test("t2", tuple(1.01 * f for f in FREQUENCIES))]
    changed = 0 if first else 1
    tests[changed] = replace(tests[changed], **unknown)
    assert not any("contradict" in each for each in usable(tests, HANGER).remarks)


def test_usable_unknown_temperatures() -> None:
    tests = [_test("t1"), _test("t2", tuple(1.01 * f for f in FREQUENCIES))]
    unknown = [replace(each, temperature_c=NAN) for each in tests]
    assert not any("contradict" in each for each in usable(unknown, HANGER).remarks)


def test_an_unknown_temperature_among_known_ones_is_said() -> None:
    unknown = replace(_test("t2"), temperature_c=NAN)
    (remark,) = usable([_test("t1"), unknown], HANGER).remarks
    assert remark.startswith("No temperature is known of test t2")


def test_shapes_without_standard_deviation_are_said() -> None:
    test = _test()
    shaped = replace(test.modes[0], shape=(ShapePoint(3.0, 1.0), ShapePoint(5.0, 0.5, sd=0.01)))
    (remark,) = usable([replace(test, modes=(shaped, *test.modes[1:]))], HANGER).remarks
    assert remark.startswith("1 of 2 points of mode shapes have no standard deviation")


def _with_sensor(x_m: float) -> ModalTest:
    test = _test()
    shaped = replace(test.modes[0], shape=(ShapePoint(x_m, 1.0),))
    return replace(test, modes=(shaped, *test.modes[1:]))


@pytest.mark.parametrize(
    ("tests", "said"),
    [
        ([_test("t1"), _test("t1")], "test id t1 is given 2 times"),
        ([replace(_test(), hanger=4)], "is of hanger 4, not of 3"),
        ([replace(_test(), added_mass=AddedMass(25.0, 13.0))], "added mass at 13 m is beyond"),
        ([_with_sensor(13.0)], "a sensor of transverse 1 at 13 m is beyond"),
        ([_with_sensor(-0.01)], "a sensor of transverse 1 at -0.01 m is beyond"),
        ([replace(_test(), modes=())], "no test holds a mode"),
    ],
)
def test_what_cannot_be_diagnosed_is_refused(tests: list[ModalTest], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        usable(tests, HANGER)
