"""How quantities go with the temperature, as the report tells it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from shm.report.as_text import as_text
from shm.report.contents import HangerReport
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_tables import temperature_documents, temperature_table
from shm.report.states import StatesOverTime
from shm.values import FloatArray, TemperatureCoefficient

TENSION = TemperatureCoefficient("tension", -0.0012, 0.0003, 0.004)
SPRING = TemperatureCoefficient("transverse_end_stiffness", 0.002, 0.0005, 0.05)
UNSEEN = TemperatureCoefficient("tension", -0.0001, 0.0039, 0.004)


def states(
    *coefficients: TemperatureCoefficient, temperatures_c: tuple[float, ...] = (3.0, 12.0, 21.0)
) -> StatesOverTime:
    warmth: FloatArray = np.array(temperatures_c)
    times = tuple(datetime(2026, month + 1, 1, tzinfo=UTC) for month in range(len(warmth)))
    outlier = np.zeros(len(warmth), bool)
    return StatesOverTime(times, warmth, 12.0, outlier, (), temperature_coefficients=coefficients)


def test_each_quantity_has_its_change_per_kelvin_in_percent_with_its_sd() -> None:
    assert temperature_table(states(TENSION, SPRING)).rows == (
        ("tension", "-0.120 ± 0.030 % per K", "-0.169 to -0.071 % per K"),
        ("transverse end stiffness", "+0.46 ± 0.12 % per K", "+0.27 to +0.65 % per K"),
    )


@pytest.mark.parametrize(
    ("temperatures_c", "why"),
    [
        ((11.0, 12.0, 12.5), "the temperatures of the tests differ by 1.5 K only"),
        ((np.nan, np.nan), "no test with a temperature"),
        ((12.0, np.nan), "1 test with a temperature"),
        ((0.0, 25.0), "2 tests over 25 K are too few to tell it from other changes"),
    ],
)
def test_what_the_tests_do_not_say_is_said_with_the_reason(
    temperatures_c: tuple[float, ...], why: str
) -> None:
    found = states(UNSEEN, temperatures_c=temperatures_c)
    assert temperature_table(found).rows == (("tension", f"not known: {why}", ""),)
    (document,) = temperature_documents(found)
    assert document["known"] is False
    assert document["why_not_known"] == why


def test_two_tests_tell_no_swing_from_a_change_however_sharp_they_are() -> None:
    (row,) = temperature_table(states(TENSION, temperatures_c=(8.0, 20.0))).rows
    assert row[1] == "not known: 2 tests over 12 K are too few to tell it from other changes"


def test_text_and_document_of_a_report_hold_them(season: HangerReport) -> None:
    data = replace(season, states=states(TENSION))
    assert "CHANGE WITH THE TEMPERATURE" in as_text(hanger_paper(data))
    assert "-0.120 ± 0.030 % per K" in as_text(hanger_paper(data))
    assert hanger_json(data)["temperature_coefficients"] == [
        {
            "quantity": "tension", "unit": "fraction per K", "mean": -0.0012, "sd": 0.0003,
            "prior_sd": 0.004, "known": True, "why_not_known": "",
        }
    ]  # fmt: skip
    assert "CHANGE WITH THE TEMPERATURE" not in as_text(hanger_paper(season))
