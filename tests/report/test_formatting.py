"""Numbers in words: decimals follow the interval, the unknown is said."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import pytest

from shm.report import formatting
from shm.report.formatting import Interval
from shm.values.rounding import force_unit, unbroken
from tests.helpers.nouns import a_posterior

KILONEWTON = force_unit(1e5)
WIDE = Interval(469.3e3, 317.2e3, 711.4e3)


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        # An interval has as many decimals as its width deserves, alike in tables and sentences.
        (formatting.with_interval(Interval(655.4, 640.2, 671.3), "kN"),
         "655 kN (90 % interval 640 to 671 kN)"),
        (formatting.with_interval(Interval(655.44, 654.62, 656.31), "kN"),
         "655.44 kN (90 % interval 654.62 to 656.31 kN)"),
        (formatting.with_interval(Interval(3200.0, 1000.0, 9000.0), "kN"),
         "3200 kN (90 % interval 1000 to 9000 kN)"),
        (formatting.with_half(WIDE, KILONEWTON), "470 ± 200 kN"),
        (unbroken("by 7.2 ± 2.0 % (90 % interval)"),
         "by 7.2 ±\N{NO-BREAK SPACE}2.0\N{NO-BREAK SPACE}% (90 % interval)"),
        (formatting.tension(WIDE, KILONEWTON), "470 kN (90 % interval 320 to 710 kN)"),
        (formatting.signed_percent(Interval(-0.0804, -0.0991, -0.0612)),
         "-8.0 % (90 % interval -9.9 to -6.1 %)"),
        (formatting.decimals(math.nan), 1),
        (formatting.decimals(0.0), 1),
        # A probability pretends no certainty.
        *((formatting.probability(value), words) for value, words in (
            (0.5, "0.50"), (0.99999, "> 0.99"), (1e-9, "< 0.01"), (0.006, "< 0.01"),
            (math.nan, "not known"))),
        *((formatting.spoken_probability(value), words) for value, words in (
            (0.99999, "above 0.99"), (0.5, "0.50"), (1e-9, "below 0.01"))),
        (formatting.number(math.nan, ".3f"), "not known"),
        (formatting.temperature(math.nan), "temperature not recorded"),
        (formatting.moment(None), "time not recorded"),
        (formatting.moment(datetime(2026, 5, 1, 12, 30, tzinfo=timezone(timedelta(hours=2)))),
         "2026-05-01 10:30 UTC"),
        (formatting.quantity("transverse_end_stiffness"), "transverse end stiffness"),
        # An adopted class is told without its ranges.
        (formatting.model_class("beam2"), "beam2"),
        (formatting.model_class("beam1+point_mass@everywhere:x_m=3.397..3.402"),
         "beam1 + point mass"),
        (formatting.model_class(
            "beam1+stiff_end_zones@arch_end.longitudinal+sag@everywhere.transverse"),
         "beam1 + stiff end zones (arch end, longitudinal) + sag (everywhere, transverse)"),
    ],
)  # fmt: skip
def test_value_is_told(told: object, expected: object) -> None:
    assert told == expected


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
