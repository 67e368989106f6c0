"""Days written as figures: the orders in which they can be read, and what proves one."""

from __future__ import annotations

from datetime import UTC, date, datetime

import pytest

from shm.read.stamps import DayOrder, find_day_order, follow_days, possible_times, stamp_of


@pytest.mark.parametrize(
    ("text", "order"),
    [
        ("14/05/2026", "day first"),
        ("05/14/2026", "month first"),
        ("26/02/99", "day first"),
        ("02/14/26", "month first"),
        ("95/02/03", "year first"),
        ("26/02/03", None),
        ("14/05/26", None),
        ("04/05/06", None),
        ("04/05/2026", None),
        ("2026-05-14", None),
        ("14.05.26", None),
    ],
)
def test_find_day_order_proof(text: str, order: DayOrder | None) -> None:
    assert find_day_order([text]) == order


@pytest.mark.parametrize(
    ("text", "days"),
    [
        ("26/02/03 10:00", [date(2003, 2, 26), date(2026, 2, 3)]),
        ("1/2/26 10:00 AM", [date(2026, 2, 1), date(2026, 1, 2)]),
        ("05/05/2026", []),
        ("14.05.26", []),
        ("2026/05/04", []),
        ("2026.05.04", []),
    ],
)
def test_possible_times_of_text(text: str, days: list[date]) -> None:
    assert [each.time.date() for each in possible_times(text)] == days
    found = stamp_of(text)
    assert found is not None
    assert found.is_certain() == (not days)


def test_order_that_a_day_cannot_have() -> None:
    """An order that a day cannot have leaves it uncertain."""
    found = stamp_of("26/02/03")
    assert found is not None
    assert not found.is_certain("month first")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("14-May-2026 09:12:00.5 PM", datetime(2026, 5, 14, 21, 12, 0, 500_000, UTC)),
        ("Thu May 14 09:12:00 2026", datetime(2026, 5, 14, 9, 12, tzinfo=UTC)),
        ("May 14, 2026", datetime(2026, 5, 14, tzinfo=UTC)),
        ("31-Apr-2026", None),
        ("14-May-2026 25:00", None),
    ],
)
def test_months_that_are_words(text: str, expected: datetime | None) -> None:
    found = stamp_of(text)
    assert (found and found.time()) == expected


def test_follow_days_past_midnight() -> None:
    assert follow_days("26/02/28 23:59", "26/03/01 00:01") == "year first"
    assert follow_days("04/05/06 23:59", "05/05/06 00:01") == "day first"
    assert follow_days("04/05/06 10:00", "04/05/06 10:01") is None
