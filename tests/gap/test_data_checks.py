"""Bad input of a diagnosis is said in words, with what it does to the answer."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from shm.errors import BadInput
from shm.gap.hypotheses.data_checks import usable
from shm.values import NAN, AddedMass, Hanger, ModalTest, Mode, Scatter, ShapePoint

HANGER = Hanger(3, 12.0, 200e9, 0.01327, 1.402e-5, 103.5, 711e3)
FREQUENCIES = (5.6, 13.5, 24.6, 39.1, 57.1, 78.6)
AGAIN = tuple(1.00001 * hz for hz in FREQUENCIES)  # no two measurements agree to the last digit


def a_test(
    name: str = "t1", frequencies: tuple[float, ...] = FREQUENCIES, sd: float = 1e-4
) -> ModalTest:
    modes = tuple(
        Mode(plane, order, frequency, sd * frequency)  # type: ignore[arg-type]
        for plane in ("transverse", "longitudinal")
        for order, frequency in enumerate(frequencies, 1)
    )
    return ModalTest(name, modes, hanger=3, temperature_c=10.0, amplitude=1.0)


def with_modes(test: ModalTest, *first: Mode) -> ModalTest:
    """Return a test with other first modes."""
    return replace(test, modes=(*first, *test.modes[len(first) :]))


ONE, OTHER = a_test("t1"), a_test("t2", AGAIN)
OFF = a_test("t2", tuple(1.01 * hz for hz in FREQUENCIES))
FEW = replace(ONE, modes=ONE.modes[:3])
FIRST = replace(ONE, modes=ONE.modes[:1], tension_read_n=7e5, tension_read_sd_n=7e3)
IRREGULAR = replace(ONE.modes[0], irregular=True)
SHAPED = replace(ONE.modes[0], shape=(ShapePoint(3.0, 1.0), ShapePoint(5.0, 0.5, sd=0.01)))


def test_usable_good_tests_as_they_are() -> None:
    found = usable((ONE, OTHER), HANGER)
    assert found.tests == (ONE, OTHER)
    assert found.remarks == ()


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("rad/s", 2 * math.pi), ("rpm", 60.0), ("kHz", 1e-3), ("s (periods)", None)],
)
def test_usable_frequencies_in_another_unit(unit: str, factor: float | None) -> None:
    given = tuple(factor * hz if factor else 1 / hz for hz in FREQUENCIES)
    try:
        said = usable([a_test("t1", given)], HANGER).remarks[0]
    except BadInput as refused:  # of periods, which fall as orders rise
        said = str(refused)
    assert f"look given in {unit}, not in Hz" in said
    for tension_n in (0.4 * 711e3, 2.5 * 711e3):
        assert not usable([ONE], replace(HANGER, nominal_tension_n=tension_n)).remarks


@pytest.mark.parametrize(
    ("tests", "hanger", "remarks"),
    [
        ([replace(ONE, modes=ONE.modes[:1])], HANGER,
         ["Only one mode is given (transverse 1): tension alone can follow"]),
        ([FEW], replace(HANGER, nominal_tension_n=0.0),
         ["the bar carries no tension that could follow them, so that a gap can show, but most"]),
        ([FEW], replace(HANGER, scatter=Scatter(tension=0.01)),
         ["the tension is known to 1 %, so that a gap can show, but most causes look alike"]),
        ([FIRST, replace(FIRST, id="t2", tension_read_n=8e5)], HANGER,
         ["a gap shows only where the frequencies do not change as the tensions"]),
        ([FIRST, replace(OTHER, modes=OTHER.modes[:1], tension_read_n=7e5)], HANGER,
         ["tension alone can follow", "The tension read, 700 kN, is not used"]),
        ([with_modes(ONE, IRREGULAR)], HANGER,
         ["is transverse 1 of test t1 (5.6 Hz): the diagnosis takes it, `shm update` leaves it"]),
        ([a_test(sd=NAN)], HANGER,
         ["No frequency has a standard deviation", "rounded to 0.1 Hz: errors of 0.52 % of the"]),
        ([a_test(sd=0.0)], HANGER,
         ["No frequency has a standard deviation (0 is none): how exact", "rounded to 0.1 Hz"]),
        ([replace(ONE, modes=(*ONE.modes[:6], *a_test(sd=NAN).modes[6:]))], HANGER,
         ["6 of 12 frequencies have no standard deviation", "rounded to 0.1 Hz"]),
        ([ONE, replace(OTHER, temperature_c=NAN)], HANGER, ["No temperature is known of test t2"]),
        ([with_modes(ONE, SHAPED)], HANGER,
         ["1 of 2 points of mode shapes have no standard deviation (0 is none): they are not"]),
        ([with_modes(ONE, replace(SHAPED, shape=(ShapePoint(3.0, 1.0, sd=0.0),)))], HANGER,
         ["1 of 1 points of mode shapes have no standard deviation (0 is none)"]),
        ([ONE, a_test("t2", (5.6, 13.5, 24.846, 39.1, 57.1, 78.6))], HANGER,
         ["Tests t1 and t2 contradict each other: transverse 3 differs by 1.00 %"]),
        ([ONE, replace(ONE, id="t2")], HANGER, ["t2 (as t1)"]),
        ([replace(ONE, amplitude=0.1, rattles_above=0.1)], HANGER,
         ["something knocks, such as a guide with play, slips or opens. The frequencies are"]),
        ([replace(ONE, rattles_above=0.4)], HANGER, ["The frequencies are means over ring-downs"]),
    ],
)  # fmt: skip
def test_usable_remarks(tests: list[ModalTest], hanger: Hanger, remarks: list[str]) -> None:
    found = usable(tests, hanger).remarks
    assert len(found) == len(remarks)
    for remark, said in zip(found, remarks, strict=True):
        assert said in remark


@pytest.mark.parametrize(
    "changed",
    [
        replace(OFF, temperature_c=25.0),
        replace(OFF, amplitude=2.0),
        replace(OFF, added_mass=AddedMass(25.0, 3.6)),
        replace(OFF, temperature_c=NAN),
        replace(OFF, amplitude=NAN),
        replace(OFF, tension_read_n=500e3),
    ],
)
def test_usable_other_or_unknown_conditions_contradict_nothing(changed: ModalTest) -> None:
    for tests in ([ONE, changed], [replace(changed, id="t0"), OTHER]):
        assert not any("contradict" in each for each in usable(tests, HANGER).remarks)


def test_usable_leaves_out_modes_given_twice_or_out_of_order() -> None:
    swapped = a_test(frequencies=(5.6, 24.6, 13.5, 39.1, 57.1, 78.6))
    found = usable([swapped], HANGER)
    assert {mode.order for mode in found.tests[0].modes} == {1, 4, 5, 6}
    said = "Left out: test t1, transverse 3 (13.5 Hz) does not lie above transverse 2 (24.6 Hz)"
    assert said in found.remarks[0]
    found = usable([replace(ONE, modes=(*ONE.modes, ONE.modes[0]))], HANGER)
    assert ("transverse", 1) not in [(mode.plane, mode.order) for mode in found.tests[0].modes]
    assert "given twice" in found.remarks[0]


@pytest.mark.parametrize(
    ("tests", "said"),
    [
        ([ONE, ONE], "test id t1 is given 2 times"),
        ([replace(ONE, hanger=4)], "is of hanger 4, not of 3"),
        ([replace(ONE, added_mass=AddedMass(25.0, 13.0))], "added mass at 13 m is beyond"),
        (
            [with_modes(ONE, replace(SHAPED, shape=(ShapePoint(13.0, 1.0),)))],
            "a sensor of transverse 1 at 13 m is beyond",
        ),
        (
            [with_modes(ONE, replace(SHAPED, shape=(ShapePoint(-0.01, 1.0),)))],
            "a sensor of transverse 1 at -0.01 m is beyond",
        ),
        ([replace(ONE, modes=())], "no test holds a mode"),
    ],
)
def test_usable_refused(tests: list[ModalTest], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        usable(tests, HANGER)
