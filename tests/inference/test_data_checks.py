"""What the checks on data leave out, count once and say, and that every answer says it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import shm
from shm.errors import BadInput
from shm.gap import GapOptions, diagnose
from shm.gap.hypotheses.data_checks import usable
from shm.inference import UpdateOptions, update
from shm.inference.problem.data_checks import check_data, check_for_update, find_line_hz
from shm.models import DESCRIPTION, THESIS, build
from shm.report.diagnosis_summary import write_lead
from shm.values import NAN, Hanger, ModalTest, Mode, Scatter, Selection
from tests.helpers.effects import all_but
from tests.helpers.hangers import HANGER_3

FEW = UpdateOptions(samples=300, seed=1)


STEEL = {"elastic_modulus_pa": 200e9, "density_kg_m3": 7850.0}
BAR = shm.round_bar(1, diameter_m=0.022, length_m=0.9, nominal_tension_n=8000.0, **STEEL)
STRING = shm.round_bar(1, diameter_m=0.0004, length_m=0.65, nominal_tension_n=14.0, **STEEL)
STRING = replace(STRING, scatter=Scatter(section=0.05))
STAY = replace(
    STRING,
    length_m=14.0,
    elastic_modulus_pa=120e9,
    area_m2=5.2e-5,
    second_moment_m4=2.6e-10,
    mass_per_length_kg_m=0.42,
    nominal_tension_n=200.0,
    scatter=Scatter(),
)
TAUT = replace(STAY, nominal_tension_n=6200.0)


def first(name: str, frequency_hz: float, sd_hz: float = NAN, read_n: float = NAN) -> ModalTest:
    """Return a test of one mode at 20 degrees."""
    modes = (Mode("transverse", 1, frequency_hz, sd_hz),)
    return ModalTest(name, modes, hanger=1, temperature_c=20.0, tension_read_n=read_n)


def modes_of(name: str, frequencies: tuple[float, ...], sd_hz: float = NAN) -> ModalTest:
    """Return a test of several modes of one plane."""
    modes = tuple(Mode("transverse", n, hz, sd_hz) for n, hz in enumerate(frequencies, 1))
    return ModalTest(name, modes, hanger=1, temperature_c=18.0)


# The tension read of nine weights, and the frequency; the last is low by sqrt 2.
READ = (
    (28.2, 128.824),
    (14.6, 92.265),
    (7.4, 65.375),
    (18.9, 104.494),
    (9.8, 75.925),
    (5.1, 53.512),
    (9.8, 75.444),
    (5.1, 54.917),
    (2.7, 27.473),
)
NINE = [
    replace(first(f"w{number}", hz, 0.2, read_n), tension_read_sd_n=0.05)
    for number, (read_n, hz) in enumerate(READ, 1)
]
TEN = [modes_of(f"hit{number}", (129.19921875, 344.53125)) for number in range(10)]
SLIP = modes_of("t1", (4.339, 8.678), 0.02)
EIGHT = (122.797, 246.603, 371.604, 495.329, 620.92, 745.741, 871.094, 997.801)


def test_one_gross_error_among_nine_is_named_and_left_out() -> None:
    checked = check_data(NINE, STRING)
    assert [test.id for test in checked.tests] == [f"w{number}" for number in range(1, 9)]
    (remark,) = checked.remarks
    assert remark.startswith("Left out: test w9. Its transverse 1, 27.473 Hz, is 31 % lower")
    assert usable(NINE, STRING).tests == checked.tests


def test_a_posterior_says_first_what_it_left_out() -> None:
    posterior = update(NINE, build("beam1", STRING), FEW)
    assert "w9" not in posterior.tests
    assert posterior.caveats[0].startswith("Left out: test w9")
    assert Selection((posterior,), (1.0,)).averaged.caveats[0].startswith("Left out: test w9")
    assert not any("w9" in each for each in posterior.faults)


def test_ten_equal_readings_count_as_one_of_a_line() -> None:
    checked = check_data(TEN, BAR)
    (test,) = checked.tests
    line_hz = 44100 / 4096
    assert [mode.frequency_sd_hz for mode in test.modes] == pytest.approx(2 * [line_hz / 12**0.5])
    (remark,) = checked.remarks
    assert remark.startswith("Counted once: 2 frequencies are the same to the last digit in 10 tes")
    assert "10.77 Hz apart give a standard deviation of 3.1 Hz, 2.4 %" in remark
    assert check_data([replace(each, hanger=None) for each in TEN], BAR).remarks == checked.remarks


@pytest.mark.parametrize(
    ("frequencies", "line_hz"),
    [
        ((129.19921875, 344.53125), 44100 / 4096),
        ((129.199, 344.531), 44100 / 4096),
        ((28.125, 53.125, 90.625), 3.125),  # 12800 Hz, 4096 samples
        ((5.6, 13.5, 24.6), 0.1),
        ((5.6123, 13.51), 0.0),
        ((129.1993417, 344.5390221), 0.0),
    ],
)
def test_the_line_is_inferred_where_it_can_be(
    frequencies: tuple[float, ...], line_hz: float
) -> None:
    assert find_line_hz(frequencies) == pytest.approx(line_hz)


BRIDGE = Hanger(3, 12.0, 200e9, 0.01327, 1.402e-5, 103.5, 711e3)
FOUR = (5.6, 13.5, 24.6, 39.1)


def several(*factors: float, of: int | None = None) -> list[ModalTest]:
    """Return tests whose frequencies, or the one of an order, are those of a bar times a factor."""
    return [
        modes_of(
            f"t{number}",
            tuple(
                hz * (factor if of in (None, order) else 1.0) * (1 + 1e-5 * number)
                for order, hz in enumerate(FOUR, 1)
            ),
            0.001,
        )
        for number, factor in enumerate(factors)
    ]


def test_only_the_wrong_mode_of_a_test_is_left_out() -> None:
    checked = check_data(several(1.0, 1.0, 1.0, 1.05, of=2), BRIDGE)
    assert [len(test.modes) for test in checked.tests] == [4, 4, 4, 3]
    assert checked.remarks[0].startswith("Left out: transverse 2 of test t3. It, 14.17")


@pytest.mark.parametrize(
    "factors", [(1.0, 0.9), (1.0, 1.0, 0.9, 0.9)], ids=["two tests", "half of four"]
)
def test_without_a_majority_the_contradiction_is_named(factors: tuple[float, ...]) -> None:
    tests = several(*factors)
    checked = check_data(tests, BRIDGE)
    assert checked.tests == tuple(tests)
    (remark,) = checked.remarks
    assert remark.startswith("Tests t")
    assert "contradict each other: transverse" in remark
    posterior = update(tests, build("beam1", BRIDGE), FEW)
    assert remark in posterior.faults


def test_scatter_and_temperature_are_no_gross_errors() -> None:
    tests = several(1.0, 1.001, 0.999, 1.002)
    assert check_data(tests, BRIDGE).remarks == ()
    cold = several(1.0, 1.0, 1.0, 1.04)
    cold[3] = replace(cold[3], temperature_c=-10.0)
    assert check_data(cold, BRIDGE).remarks == ()


def test_a_nominal_tension_that_slipped_is_named_with_what_a_taut_string_carries() -> None:
    posterior = update([SLIP], build("beam1", STAY), FEW)
    assert posterior.caveats[0].endswith("Give them in Hz, or check nominal_tension_n.")
    assert posterior.caveats[1].startswith("At the bound of its prior: theta_F")
    said = "A taut string would need 6.199 kN, 31 times the nominal: check nominal_tension_n, its u"
    assert said in posterior.caveats[1]
    assert sum("taut string" in each for each in posterior.caveats) == 1
    nominal = replace(STAY, nominal_tension_n=6.2e3)
    assert not any("taut" in each for each in update([SLIP], build("beam1", nominal), FEW).caveats)


def test_a_slender_string_is_not_called_a_stiff_bar() -> None:
    hanger = replace(STRING, nominal_tension_n=26.0)
    test = replace(modes_of("w1", EIGHT, 0.3), tension_read_n=26.0, tension_read_sd_n=0.1)
    found = diagnose([test], hanger, GapOptions(without=all_but()))
    assert found.slenderness == pytest.approx(207, rel=0.05)
    assert found.leads == "no gap"
    missed = replace(found, shrinkage=replace(found.shrinkage, rms_before_percent=2.0))
    assert "stiff a bar" not in write_lead(missed)
    assert "light string" in write_lead(missed)
    assert "stiff a bar" in write_lead(replace(missed, slenderness=12.0))
    assert "stiff a bar" not in write_lead(replace(missed, slenderness=NAN))


def test_the_thesis_counts_copies_as_given() -> None:
    assert check_for_update(TEN, build("beam1", HANGER_3, THESIS)) == (TEN, {})
    assert check_for_update(TEN, build("beam1", BAR, DESCRIPTION))[0] != TEN


def test_what_is_left_must_hold_a_mode() -> None:
    fallen = modes_of("t1", (20.0, 10.0), 0.1)
    with pytest.raises(BadInput, match=r"mode that can be used\. Left out: test t1"):
        update([fallen], build("beam1", BRIDGE), FEW)


def test_what_only_the_hardest_hits_show_is_kept() -> None:
    tests = [replace(each, amplitude=1.0) for each in several(1.0, 1.0, 1.0, 1.1, of=1)]
    assert len(check_data(tests, BRIDGE).tests[3].modes) == 3
    tests[3] = replace(tests[3], amplitude=2.0)
    assert check_data(tests, BRIDGE).tests == tuple(tests)


def test_reading_in_another_unit_is_left_out_and_said() -> None:
    in_kn = [replace(SLIP, tension_read_n=6.2), modes_of("t2", (4.34, 8.68), 0.02)]
    checked = check_data(in_kn, TAUT)
    assert math.isnan(checked.tests[0].tension_read_n)
    (remark,) = checked.remarks
    assert remark.startswith("Left out: the tension read in test t1, 6.2 N, is 0.001 ")
    assert remark.endswith("of what a taut string with these frequencies carries: give it in N.")
    right = [replace(SLIP, tension_read_n=5000.0)]
    assert check_data(right, TAUT).tests == tuple(right)


def test_stated_error_larger_than_any_reading_is_named() -> None:
    wide = replace(SLIP, modes=(replace(SLIP.modes[0], frequency_sd_hz=100.0), *SLIP.modes[1:]))
    (remark,) = check_data([wide], TAUT).remarks
    assert "a standard deviation of 100 Hz of transverse 1, 4.339 Hz: check its unit" in remark
    assert check_data([modes_of("t1", (4.339, 8.678), 0.1)], TAUT).remarks == ()


def test_stated_error_of_zero_counts_as_not_stated() -> None:
    zero = replace(SLIP, modes=tuple(replace(each, frequency_sd_hz=0.0) for each in SLIP.modes))
    count = len(SLIP.modes)
    said = f"A standard deviation of 0 counts as not stated ({count} of {count} frequencies)."
    _, fields = check_for_update([zero], build("beam1", TAUT))
    assert said in fields["remarks"]
    assert said not in check_for_update([SLIP], build("beam1", TAUT))[1]["remarks"]


def test_other_unit_is_said_first_and_no_other_orders_where_nothing_fits() -> None:
    posterior = update(TEN[:1], build("beam1", BAR), FEW)
    unit = "The frequencies look given in rad/s, not in Hz: they are 6.3 times those."
    off = replace(
        posterior,
        at_bounds=("theta_F",),
        misfit_percent=74.0,
        remarks=("Left out: a mode.", unit),
        tension_of_other_orders_n=7000.0,
        taut_string_tension_n=120.0 * posterior.nominal_tension_n,
    )
    assert off.caveats[0] == unit
    said = " ".join(off.caveats)
    assert "Do not use this tension" in said
    assert "The orders decide" not in said
    assert "120 times the nominal" in said
    assert "The orders decide" in " ".join(replace(off, misfit_percent=3.0).caveats)
