"""The tension that every face leads with: which tests it rests on, and how sure it is."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.pipeline.courier import with_tension
from shm.report.hanger_status import Status
from shm.report.hanger_summary import (
    BASELINE_ALONE,
    BASELINE_AND_CHANGE,
    BASELINE_TESTS,
    LATEST_TEST,
    HangerSummary,
    LatestTest,
)
from shm.values import NAN, Averaged, Drift, Limits, Summary
from shm.values.posterior import LEFT_OUT
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import NOW, a_change, an_alert

BASE_N, SD = 700e3, 8e3


def tension(mean_n: float = BASE_N, sd_n: float = SD, caveats: tuple[str, ...] = ()) -> Averaged:
    half = 1.645 * sd_n
    spread = Summary(mean_n, sd_n, mean_n - half, mean_n, mean_n + half)
    return Averaged(spread, 2e3, caveats=caveats)


def drift(shift: float, sd: float = 0.005, probability: float = 0.0) -> Drift:
    return Drift(
        3, "t9", NOW, "tension", BASE_N, BASE_N * (1 + shift), shift, sd, 0.05, probability
    )


def now(**changes: Any) -> HangerSummary:
    given = {
        "latest": LatestTest("t9", NOW, replace(tension(650e3), repeatability_sd_n=1.5e3)),
        "baseline": tension(),
        "drifts": (drift(-0.08, probability=0.99),),
    }
    return HangerSummary(HANGER_3, **{**given, **changes})


def mean_n(summary: HangerSummary) -> float:
    assert summary.tension is not None
    return summary.tension.tension_n.mean


def test_after_a_change_it_is_the_baseline_moved_by_the_change_and_not_the_latest_test() -> None:
    """Against draws of the baseline times those of the change, taken as independent."""
    found = now()
    rng = np.random.default_rng(1)
    draws = rng.normal(BASE_N, SD, 400_000) * (1 + rng.normal(-0.08, 0.005, 400_000))
    assert found.tension is not None
    assert found.basis == BASELINE_AND_CHANGE
    known = found.tension.tension_n
    assert known.mean == pytest.approx(draws.mean(), rel=1e-4)
    assert known.sd == pytest.approx(draws.std(), rel=0.01)
    expected = np.quantile(draws, [0.05, 0.5, 0.95])
    assert [known.q05, known.q50, known.q95] == pytest.approx(expected.tolist(), rel=1e-3)
    assert found.document["by_latest_test"]["tension_n"]["mean"] == 650e3
    assert found.tension.repeatability_sd_n == 1.5e3  # of the latest test, as its own is


@pytest.mark.parametrize(
    ("changes", "basis", "mean"),
    [
        ({"drifts": (drift(0.004),)}, BASELINE_AND_CHANGE, 1.004 * BASE_N),  # nothing detected
        # Nothing was found, and a shift beyond the threshold would not have been seen.
        ({"drifts": (drift(0.03, sd=0.04),)}, BASELINE_ALONE, BASE_N),
        # A detected change moves it however rough the tests.
        ({"drifts": (drift(-0.2, sd=0.04, probability=0.97),), "called": (a_change(),)},
         BASELINE_AND_CHANGE, 0.8 * BASE_N),
        ({"drifts": (drift(NAN, NAN, NAN),)}, BASELINE_ALONE, BASE_N),
        ({"drifts": (), "is_first": True}, BASELINE_TESTS, BASE_N),
        ({"drifts": (), "baseline": None}, LATEST_TEST, 650e3),  # never compared
        ({"drifts": ()}, LATEST_TEST, 650e3),
    ],
)  # fmt: skip
def test_tension_rests_on(changes: dict[str, Any], basis: str, mean: float) -> None:
    found = now(**changes)
    assert found.basis == basis
    assert found.is_found is ("called" in changes)
    assert mean_n(found) == pytest.approx(mean)
    if basis == BASELINE_TESTS or (found.drifts and math.isnan(found.drifts[0].shift_sd)):
        assert found.change is None


def test_a_hanger_without_a_test_has_neither_tension_nor_change() -> None:
    found = HangerSummary(HANGER_3)
    assert (found.tension, found.change, found.basis, found.of_nominal) == (None, None, "", None)
    assert not found.is_determined


def test_doubts_of_the_baseline_hold_for_what_rests_on_it() -> None:
    doubt = "The description does not fit. Do not use this tension."
    found = now(baseline=tension(caveats=(doubt,)))
    assert found.tension is not None
    assert found.tension.faults == (doubt,)
    assert now().message.status is Status.ALERT


@pytest.mark.parametrize(
    ("drifts", "basis", "caveats"),
    [
        ((drift(0.03, sd=0.04),), BASELINE_ALONE, (LEFT_OUT,)),
        ((drift(0.004),), BASELINE_AND_CHANGE, (LEFT_OUT, "Do not use this tension.")),
    ],
)
def test_caveats_are_of_the_tension_shown(
    drifts: tuple[Drift, ...], basis: str, caveats: tuple[str, ...]
) -> None:
    """A hopeless latest test does not spoil the baseline, but is said, and is not quiet."""
    hopeless = tension(300e3, caveats=("Do not use this tension.",))
    found = now(
        latest=LatestTest("t9", NOW, hopeless), baseline=tension(caveats=(LEFT_OUT,)), drifts=drifts
    )
    assert found.tension is not None
    assert (found.basis, found.tension.caveats) == (basis, caveats)
    assert found.message.status is Status.CHECK
    assert ("by its latest test" in found.message.words) is (basis == BASELINE_ALONE)
    assert any("Do not use this tension." in each for each in found.message.reasons)


def test_limits_are_judged_by_the_same_tension() -> None:
    """By the normal law: a limit one standard deviation below the tension has 16 %."""
    sd = math.hypot(0.92 * SD, 0.005 * BASE_N)
    limits = Limits(math.nan, 0.92 * BASE_N - sd)
    found = replace(now(), hanger=replace(HANGER_3, limits=limits))
    assert found.tension is not None
    assert found.tension.probability_slack == pytest.approx(0.1587, abs=1e-3)
    assert math.isnan(found.tension.probability_above_limit)


def test_an_interval_wider_than_half_the_tension_determines_nothing() -> None:
    wide = now(baseline=tension(sd_n=0.2 * BASE_N), drifts=(), is_first=True)
    assert not wide.is_determined
    assert "these modes do not determine the tension" in wide.message.words
    assert "±" not in wide.message.lead.state
    assert now().is_determined


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (1e-5, "The tension is now 6.44 ± 0.13 N. At the baseline it was 7.00 ± 0.13 N."),
        (1.0, "The tension is now 644 ± 13 kN. At the baseline it was 700 ± 13 kN."),
        (20.0, "The tension is now 12.88 ± 0.27 MN. At the baseline it was 14.00 ± 0.26 MN."),
    ],
)
def test_alert_states_tension_in_fitting_unit(size: float, said: str) -> None:
    found = now(baseline=tension(size * BASE_N, size * SD))
    alert = replace(an_alert(), message="Hanger 3: tension fell. Look today. Details: p 0.99.")
    told = with_tension(alert, found)
    assert told.tension == found.tension
    assert told.message == f"Hanger 3: tension fell. Look today. {said} Details: p 0.99."
    unknown = with_tension(an_alert(), now(drifts=(drift(0.03, sd=0.04),)))
    assert unknown.message == an_alert().message
    assert unknown.tension is not None
