"""The gap of an adopted class: its size, when it has grown, and how two alerts become one."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from shm.values import Alert, Posterior, PredictedFrequency
from shm.watch import has_grown, joined, watch_gap
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_drift, a_posterior

WHEN = datetime(2026, 5, 1, tzinfo=UTC)
ADOPTED = "beam1+point_mass@everywhere"


def off(*fractions: float, model: str = ADOPTED) -> Posterior:
    rows = tuple(
        PredictedFrequency("transverse", order, 10.0 * (1 + fraction), 0.01, 10.0)
        for order, fraction in enumerate(fractions, start=1)
    )
    return replace(a_posterior(model), predicted=rows)


def watched(before: Posterior, now: Posterior) -> Alert | None:
    return watch_gap(before, now, HANGER_3, test="t2", time=WHEN)


@pytest.mark.parametrize(
    ("before", "now", "grown"),
    [(0.2, 0.59, False), (0.2, 0.61, True), (0.001, 0.09, False), (0.001, 0.11, True)],
)
def test_a_gap_has_grown_beyond_three_times_and_a_tenth_of_a_percent(
    before: float, now: float, grown: bool
) -> None:
    assert has_grown(before, now) is grown


def test_a_grown_gap_of_an_adopted_class_is_an_alert_with_both_figures() -> None:
    alert = watched(off(0.002), off(0.01))
    assert alert is not None
    assert alert.key == "hanger-3:gap-up"
    assert "1.00 % off the measured ones, 0.20 % when it was adopted" in alert.message
    assert alert.drifts == ()


def test_a_gap_as_it_was_or_of_a_plain_class_is_none() -> None:
    assert watched(off(0.002), off(0.003)) is None
    assert watched(off(0.002, model="beam1"), off(0.01, model="beam1")) is None


def test_two_alerts_of_one_test_are_one_that_names_both() -> None:
    gap = watched(off(0.002), off(0.01))
    drift = Alert("hanger-3:tension-down", 3, "t2", WHEN, "Tension moved.", (a_drift(),))
    both = joined(drift, gap)
    assert both is not None
    assert gap is not None
    assert both.key == "hanger-3:tension-down:gap-up"
    assert both.message == f"Tension moved. {gap.message}"
    assert both.drifts == drift.drifts
    assert joined(drift, None) is drift
    assert joined(None, gap) is gap
    assert joined(None, None) is None
