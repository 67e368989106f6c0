"""Tables and the terminal text: every number with its unit and interval, nothing says nan."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.report.as_text import as_text, laid_out
from shm.report.contents import HangerReport
from shm.report.hanger_report import hanger_paper
from shm.report.hanger_tables import frequencies
from shm.report.paper import Table
from shm.values import Mode, PredictedFrequency

WHOLE = [
    "The bar as described",
    "Formulas of practice",
    "Changes since the baseline of test t000",
    "Frequencies",
    "Alerts, latest first",
    "Where these numbers come from",
    "Parameters of the model class beam2",
    "Model classes",
    "Tests, latest first",
    "Alerts, latest first",
    "How the posterior was computed",
]


def tables(data: HangerReport) -> tuple[Table, ...]:
    return tuple(table for part in hanger_paper(data).parts for table in part.tables)


def test_a_whole_report_has_every_table(season: HangerReport) -> None:
    assert [table.title for table in tables(season)] == WHOLE


def test_tables_without_data_are_left_out(bare: HangerReport) -> None:
    titles = [table.title for table in tables(bare)]
    assert "Model classes" not in titles
    assert "Alerts, latest first" not in titles


@pytest.mark.parametrize("name", ["season", "bare"])
def test_every_row_is_as_long_as_its_headings(name: str, request: pytest.FixtureRequest) -> None:
    for table in tables(request.getfixturevalue(name)):
        assert {len(row) for row in table.rows} == {len(table.headings)}


def test_a_frequency_that_was_not_measured_is_said(bare: HangerReport) -> None:
    table = next(table for table in tables(bare) if table.title == "Frequencies")
    assert table.rows[1][2] == "not measured"
    assert table.rows[1][-1] == "not measured"


def test_an_irregular_frequency_is_shown_without_a_prediction(bare: HangerReport) -> None:
    irregular = Mode("transverse", 9, 99.0, 0.1, irregular=True)
    latest = replace(bare.latest, modes=(*bare.latest.modes, irregular))
    shown = frequencies(replace(bare, tests=(*bare.tests[:-1], latest)))
    assert shown.rows[0][:5] == ("transverse", "9", "99.000", "0.1000", "not followed")
    assert "shm gap diagnose" in shown.note
    assert "shm gap diagnose" not in frequencies(bare).note


def test_of_a_pooled_posterior_the_latest_test_is_compared(season: HangerReport) -> None:
    earlier = PredictedFrequency("transverse", 1, 5.8, 0.05, 5.99)
    pooled = replace(season.posterior, predicted=(earlier, *season.posterior.predicted))
    assert replace(season, posterior=pooled).predicted == season.posterior.predicted


def test_a_long_history_is_cut_in_the_text_and_says_so(season: HangerReport) -> None:
    long = replace(season, trend=season.trend * 3)
    assert "... and 18 earlier ones" in as_text(hanger_paper(long))


LONG = Table(
    "Where the gap lies",
    ("mode", "test", "measured, Hz", "off, %"),
    (("transverse 3", "hanger03_20260413", "25.452 (25.441 to 25.463)", "-2.37"),),
)


def test_a_table_folds_its_widest_columns_and_cuts_no_word() -> None:
    told = laid_out(LONG, 52)
    assert max(map(len, told.splitlines())) <= 52
    assert {"transverse", "hanger03_20260413", "25.463)", "-2.37"} <= set(told.split())


def test_the_names_of_tests_break_before_any_word() -> None:
    told = laid_out(LONG, 46)
    assert max(map(len, told.splitlines())) <= 46
    assert "hanger03_20260413" not in told
    assert {"transverse", "measured,", "25.463)"} <= set(told.split())


def test_a_table_without_room_for_its_words_stands_as_lists() -> None:
    lines = [line.split() for line in laid_out(LONG, 34).splitlines()]
    assert ["mode", "transverse", "3"] in lines
    assert ["off,", "%", "-2.37"] in lines


def test_formulas_of_practice_stand_beside_ours(season: HangerReport) -> None:
    """The taut string by hand: T = 4 m (f L)^2."""
    (made,) = [t for t in tables(season) if t.title == "Formulas of practice"]
    hanger = season.hanger
    first = next(m for m in season.latest.modes if (m.plane, m.order) == ("transverse", 1))
    string_n = 4 * hanger.mass_per_length_kg_m * (first.frequency_hz * hanger.length_m) ** 2
    assert made.rows[0][:2] == ("taut string, mode 1", f"{season.tension_unit.of(string_n):.0f}")
    assert [row[0] for row in made.rows[-2:]] == [
        "equal springs, all modes",
        "ours, by all modes of the same test",
    ]
