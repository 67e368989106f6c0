"""Days written as figures: the orders in which they can be read, and what proves one."""

from __future__ import annotations

from datetime import date

import pytest

from shm.read.stamps import DayOrder, find_day_order, follow_days, parsed, possible_times


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
    found = parsed(text)
    assert found is not None
    assert found[1] == (not days)


def test_parsed_order_of_another_form() -> None:
    """An order that a day cannot have leaves it uncertain."""
    found = parsed("26/02/03", "month first")
    assert found is not None
    assert not found[1]


def test_follow_days_past_midnight() -> None:
    assert follow_days(["26/02/28 23:59", "26/03/01 00:01"]) == "year first"
    assert follow_days(["04/05/06 23:59", "05/05/06 00:01"]) == "day first"
    assert follow_days(["04/05/06 10:00", "04/05/06 10:01"]) is None
