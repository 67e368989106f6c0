"""A report of a period: how one writes it, what it holds, what changed in it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from shm.errors import UsageError
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_sentences import in_period, summary
from shm.report.states import Period, period_since
from tests.report.conftest import START

NOW = datetime(2026, 9, 10, 12, tzinfo=UTC)


@pytest.fixture(scope="module")
def recent(season: HangerReport) -> HangerReport:
    period = Period(START + timedelta(days=30), NOW)
    trend = tuple(row for row in season.trend if period.holds(row.time))
    return replace(season, period=period, trend=trend)


@pytest.mark.parametrize(
    ("told", "since"),
    [
        ("2026-03-01", datetime(2026, 3, 1, tzinfo=UTC)),
        ("2026-03-01T10:30:00+02:00", datetime(2026, 3, 1, 8, 30, tzinfo=UTC)),
        ("90d", NOW - timedelta(days=90)),
        (" 2w ", NOW - timedelta(days=14)),
        ("12m", NOW - timedelta(days=365.25)),
        ("1Y", NOW - timedelta(days=365.25)),
    ],
)
def test_a_period_is_written_as_a_date_or_a_span(told: str, since: datetime) -> None:
    assert period_since(told, NOW) == Period(since, NOW)


@pytest.mark.parametrize("told", ["", "yesterday", "90", "d", "2026-13-01", "-3d", "99999y", "0d"])
def test_what_is_neither_is_refused_with_an_example(told: str) -> None:
    with pytest.raises(UsageError) as refused:
        period_since(told, NOW)
    assert "90d" in refused.value.remedy


def test_a_period_that_has_not_begun_is_refused() -> None:
    with pytest.raises(UsageError, match="has not begun"):
        period_since("2027-01-01", NOW)


def test_the_change_of_two_independent_estimates_adds_in_squares() -> None:
    """(90 +- 3) of (100 +- 4): -10 %, with half width sqrt(3^2 + (0.9 * 4)^2) / 100."""
    change = Interval(90, 87, 93).since(Interval(100, 96, 104))
    assert change.mean == pytest.approx(-0.10)
    assert change.width / 2 == pytest.approx((3**2 + 3.6**2) ** 0.5 / 100)


def test_the_summary_names_the_period_and_what_changed_in_it(recent: HangerReport) -> None:
    told = summary(recent)
    assert "In the period 2026-05-31 to 2026-09-10: 7 tests, 1 alert" in told
    assert "from its first test (t003) to its last the tension moved by -7." in told


def test_a_period_with_one_test_says_that_nothing_can_be_compared(recent: HangerReport) -> None:
    one = replace(recent, trend=recent.trend[-1:])
    assert "with one test in it nothing in it can be compared" in in_period(one)


def test_every_form_names_the_period(recent: HangerReport) -> None:
    named = "2026-05-31 to 2026-09-10"
    assert as_text(hanger_paper(recent)).splitlines()[0] == f"Hanger 3, Arch bridge, {named}: Alert"
    assert f"period {named}" in as_html(hanger_paper(recent))
    assert hanger_json(recent)["period"] == {"since": START + timedelta(days=30), "until": NOW}
    titles = [table.title for part in hanger_paper(recent).parts for table in part.tables]
    assert f"Tests in the period {named}, latest first" in titles
    assert f"Alerts in the period {named}, latest first" in titles
