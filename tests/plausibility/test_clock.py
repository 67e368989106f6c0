"""Times of tests that cannot be, or that hide a change, are doubted; others pass."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime, timedelta

import pytest

from shm.plausibility import Candidate, doubts_about
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import START, modelled_test

RECEIVED = START + timedelta(days=100)
DAY = timedelta(days=1)


def doubted(time: datetime | None, tension: float = 1.0, **known: object) -> list[str]:
    """Return the checks that doubt a test of a time, received on day 100."""
    test = replace(modelled_test("t", HANGER_3, tension=tension), time=time)
    candidate = Candidate(HANGER_3, test, RECEIVED, DAY, **known)  # type: ignore[arg-type]
    return [each.check for each in doubts_about(candidate)]


@pytest.mark.parametrize(
    ("time", "checks"),
    [
        (datetime(1, 1, 1, tzinfo=UTC), ["clock before the bridge"]),
        (datetime(1979, 12, 31, tzinfo=UTC), ["clock before the bridge"]),
        (datetime(2000, 1, 1, 7, tzinfo=UTC), ["clock before the bridge"]),
        (RECEIVED + timedelta(hours=25), ["clock ahead"]),
        (datetime(9999, 12, 31, tzinfo=UTC), ["clock ahead"]),
        (RECEIVED + timedelta(hours=14), []),  # in another zone
        (datetime(1995, 5, 1, tzinfo=UTC), []),  # found in an old folder
        (None, []),
    ],
)
def test_doubts_about_times(time: datetime | None, checks: list[str]) -> None:
    assert doubted(time) == checks


def test_doubts_about_time_before_bridge() -> None:
    built, at = date(1998, 6, 1), datetime(1998, 6, 1, tzinfo=UTC)
    assert doubted(at - timedelta(hours=1), built=built) == ["clock before the bridge"]
    assert doubted(at, built=built) == []


@pytest.mark.parametrize(
    ("time", "checks"), [(START, ["clock stuck"]), (datetime(2026, 5, 2, tzinfo=UTC), [])]
)
def test_doubts_about_stuck_clock(time: datetime, checks: list[str]) -> None:
    """The very same second is doubted, a mere date is not."""
    other = modelled_test("other", HANGER_3, tension=1.1)
    assert doubted(time, same_time=[other]) == checks


@pytest.mark.parametrize(("tension", "checks"), [(0.9, ["clock before the baseline"]), (1.01, [])])
def test_doubts_about_loss_before_baseline(tension: float, checks: list[str]) -> None:
    """It could raise no alert: the watch takes it for the start."""
    known = {"reference": [modelled_test("b", HANGER_3)], "reference_at": START}
    assert doubted(START - DAY, tension, **known) == checks
