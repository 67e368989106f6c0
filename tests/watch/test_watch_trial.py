"""What the trial of the watch counts is what it says it counts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.benchmarks.watch_trial.outcomes import (
    BEGINS,
    alarm_by,
    delays,
    false_alarms,
    is_right,
    limit_at,
    ours,
    quantile,
)
from tests.benchmarks.watch_trial.rivals import cusum, ewma, standardised, without_swing


def row(*alerts: dict[str, Any], scenario: str = "quiet", cusum: list[float] | None = None) -> Any:
    """Four tests a year for three years, the event before the seventh."""
    days = [90.0 * n for n in range(13)]
    return {
        "days": days,
        "baseline": 1,
        "scenario": scenario,
        "alerts": list(alerts),
        "rivals": {"CUSUM": cusum or [0.0] * 13},
    }


def alert(at: int, kind: str = "sudden change", *moved: Any) -> dict[str, Any]:
    return {"at": at, "kinds": [kind], "moved": list(moved), "message": ""}


def test_a_cusum_adds_up_what_is_beyond_half_a_standard_deviation() -> None:
    assert cusum(np.array([1.5, np.nan, 1.5, -3.0])).tolist() == [1.0, 1.0, 2.0, 2.5]


def test_a_moving_average_forgets_and_leaves_out_what_is_missing() -> None:
    found = ewma(np.array([1.0, np.nan, 0.0, -10.0]))
    assert found == pytest.approx([0.2, 0.2, 0.16, 1.872])


def test_the_swing_with_the_temperature_is_taken_off() -> None:
    rng = np.random.default_rng(0)
    warmth = 10 + 8 * rng.standard_normal(60)
    values = 13.4 - 0.001 * warmth
    values[5] += 0.3
    rest = without_swing(values, warmth, np.arange(60) < 40)
    assert np.delete(rest, 5) == pytest.approx(0.0, abs=1e-9)


def test_a_baseline_leaves_its_outlier_out() -> None:
    values = np.array([1.0, -1.0, 1.0, -1.0, 0.0, 0.0, 50.0, 2.0])
    scaled = standardised(values, np.arange(8) < 7)
    assert np.isnan(scaled[:7]).all()
    assert scaled[7] == pytest.approx(2 / np.std(values[:6], ddof=1))


def test_years_count_until_the_first_alarm_and_notices_are_none() -> None:
    rows = [row(), row(alert(4, "repeat the test"), alert(8))]

    count, years = false_alarms(rows, ours)

    assert count == 1
    assert years == pytest.approx((12 + 8) * 90 / 365.25)


def test_delays_count_from_the_first_test_after_the_event() -> None:
    begun = int(BEGINS / 90)
    rows = [row(alert(begun)), row(alert(begun + 2)), row(), row(alert(begun - 1))]

    found = delays(rows, ours)

    assert found.tolist() == [1, 3, np.inf]
    assert quantile(found, 0.5) == 3


def test_a_limit_is_the_lowest_that_keeps_the_rate() -> None:
    rows = [row(cusum=[0.0] * 12 + [size]) for size in (1.0, 2.0, 5.0, 9.0)]
    years = false_alarms(rows, alarm_by("CUSUM", 100.0))[1]

    limit = limit_at(rows, "CUSUM", 1.01 / years)

    assert limit == 5.0
    assert false_alarms(rows, alarm_by("CUSUM", limit))[0] == 1


@pytest.mark.parametrize(
    ("scenario", "moved", "right"),
    [
        ("step3", ["tension", 0.9, -0.03, []], True),
        ("step3", ["point_mass", 0.6, -0.01, ["tension"]], True),
        ("step3", ["point_mass", 0.9, -0.01, []], False),
        ("springs", ["transverse_end_stiffness", 0.9, -0.5, []], True),
        ("lamp", ["tension", 0.9, -0.03, ["point_mass"]], True),
        ("clock", ["tension", 0.9, 0.004, []], False),
    ],
)
def test_what_was_named_is_held_against_the_truth(
    scenario: str, moved: list[Any], right: bool
) -> None:
    assert is_right(row(alert(8, "sudden change", moved), scenario=scenario)) is right
