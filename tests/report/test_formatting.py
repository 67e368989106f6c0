"""Numbers in words: decimals follow the interval, the unknown is said."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta, timezone

import pytest

from shm.report import formatting
from shm.report.formatting import Interval
from shm.values.rounding import force_unit
from tests.helpers.nouns import a_posterior

KILONEWTON = force_unit(1e5)


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        (Interval(655.4, 640.2, 671.3), "655 kN (90 % interval 640 to 671 kN)"),
        (Interval(655.44, 654.62, 656.31), "655.44 kN (90 % interval 654.62 to 656.31 kN)"),
        (Interval(3200.0, 1000.0, 9000.0), "3200 kN (90 % interval 1000 to 9000 kN)"),
    ],
)
def test_an_interval_shows_as_many_decimals_as_its_width_deserves(
    interval: Interval, expected: str
) -> None:
    assert formatting.with_interval(interval, "kN") == expected


def test_a_wide_interval_is_rounded_alike_in_tables_and_sentences() -> None:
    wide = Interval(469.3e3, 317.2e3, 711.4e3)
    assert formatting.with_half(wide, KILONEWTON) == "470 ± 200 kN"
    assert formatting.tension(wide, KILONEWTON) == "470 kN (90 % interval 320 to 710 kN)"


def test_a_width_that_is_not_known_gets_one_decimal() -> None:
    assert formatting.decimals(float("nan")) == 1
    assert formatting.decimals(0.0) == 1


def test_a_relative_change_carries_its_sign_and_its_interval() -> None:
    change = Interval(-0.0804, -0.0991, -0.0612)
    assert formatting.signed_percent(change) == "-8.0 % (90 % interval -9.9 to -6.1 %)"


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.5, "0.50"), (0.99999, "> 0.99"), (1e-9, "< 0.01"), (float("nan"), "not known")],
)
def test_a_probability_pretends_no_certainty(value: float, expected: str) -> None:
    assert formatting.probability(value) == expected


def test_a_probability_is_spelled_out_in_a_sentence() -> None:
    told = [formatting.spoken_probability(value) for value in (0.99999, 0.5, 1e-9)]
    assert told == ["above 0.99", "0.50", "below 0.01"]


def test_what_is_unknown_is_said_in_words() -> None:
    assert formatting.number(float("nan"), ".3f") == "not known"
    assert formatting.temperature(float("nan")) == "temperature not recorded"
    assert formatting.moment(None) == "time not recorded"


def test_times_are_given_in_utc() -> None:
    time = datetime(2026, 5, 1, 12, 30, tzinfo=timezone(timedelta(hours=2)))
    assert formatting.moment(time) == "2026-05-01 10:30 UTC"


def test_parameters_and_springs_have_plain_names_and_units() -> None:
    assert formatting.quantity("transverse_end_stiffness") == "transverse end stiffness"


@pytest.mark.parametrize(
    ("name", "unit", "meaning"),
    [
        ("theta_F", "1", "tension over nominal tension"),
        ("log10_k3", "N m/rad", "end stiffness k3 (transverse, arch end)"),
        ("log10_krx", "N/m", "spring krx per node (across the bridge, deck end)"),
        ("log10_stiffness_n_m", "N/m", "stiffness"),
        ("point_mass.x_m", "m", "point mass: place"),
        ("log10_k9", "", "k9"),
    ],
)
def test_meaning_is_plain(name: str, unit: str, meaning: str) -> None:
    posterior = replace(a_posterior(), names=(name, "theta_L", "sigma"), units=(unit, "1", "1"))
    assert formatting.meaning(posterior, name) == meaning


def test_a_normal_interval_holds_ninety_percent() -> None:
    interval = Interval.normal(10.0, 2.0)
    assert interval.high - 10.0 == pytest.approx(1.645 * 2.0, rel=1e-3)
    assert interval.scaled(0.5).width == pytest.approx(interval.width / 2)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("beam2", "beam2"),
        ("beam1+point_mass@everywhere:x_m=3.397..3.402", "beam1 + point mass"),
        (
            "beam1+stiff_end_zones@arch_end.longitudinal+sag@everywhere.transverse",
            "beam1 + stiff end zones (arch end, longitudinal) + sag (everywhere, transverse)",
        ),
    ],
)
def test_an_adopted_class_is_told_without_its_ranges(name: str, told: str) -> None:
    assert formatting.model_class(name) == told
