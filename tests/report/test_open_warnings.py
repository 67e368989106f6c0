"""A wrong baseline is said first, and no hanger with one is quiet."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from shm.report.hanger_status import Status, findings, status_of
from shm.report.open_warnings import nearly_slack, open_warnings, standing_out
from shm.values import (
    Alert,
    AlertKind,
    BaselineCheck,
    Change,
    MistakenMode,
    MistakenTest,
    RepeatedMistake,
    Summary,
    WatchedTest,
)
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_drift

SINCE = datetime(2026, 5, 1, tzinfo=UTC)
MODE = MistakenMode("t1", "transverse", 2, 21.3, 14.2)


def tension(share: float, half_width: float = 0.02) -> Summary:
    ends = share - half_width, share, share + half_width
    return Summary(*(each * HANGER_3.nominal_tension_n for each in (share, 0.01, *ends)))


def latest(mistaken: tuple[RepeatedMistake, ...] = (), **of_change: Any) -> WatchedTest:
    change = Change(
        **{
            "evidence_years": 1.0,
            "limit_years": 100.0,
            "probability": 0.01,
            "sudden": 0.5,
            "began_after": SINCE,
            "began_by": SINCE,
            "moved": (),
            **of_change,
        }
    )
    return WatchedTest("t9", SINCE, 10.0, (), change, mistaken=mistaken)


def row(*shares: float, families: str = "") -> str:
    """Return the warning about the third of hangers with such relative tensions."""
    families = families or "a" * len(shares)
    hangers = [replace(HANGER_3, id=n, family=f) for n, f in enumerate(families)]
    return standing_out(hangers[2], hangers, {n: tension(each) for n, each in enumerate(shares)})


@pytest.mark.parametrize(
    ("now", "is_reported", "is_said"),
    [
        (0.03, False, True),
        (0.03, True, False),  # the alert says it
        (0.6, False, False),
        (0.49, False, False),  # its interval reaches beyond half
    ],
)
def test_a_hanger_that_is_nearly_slack_by_its_own_test_is_said_first(
    now: float, is_reported: bool, is_said: bool
) -> None:
    said = nearly_slack(HANGER_3, tension(1.0), tension(now), is_reported=is_reported)
    assert bool(said) is is_said
    if is_said:
        assert said.startswith("Hanger 3 carries 3.0 ± 2.0 % of its nominal tension by its latest")
        assert len(said.split(":")[0].split()) <= 25
        assert "today" in said
        assert open_warnings(HANGER_3, None, now=(said,)) == (said,)


def test_a_mode_left_out_of_a_baseline_that_fits_is_no_warning() -> None:
    assert open_warnings(HANGER_3, BaselineCheck(modes=(MODE,))) == ()
    assert open_warnings(HANGER_3, BaselineCheck()) == ()
    assert open_warnings(HANGER_3, None) == ()


@pytest.mark.parametrize(
    ("check", "said"),
    [
        (BaselineCheck(misfit="5 of 12 modes fit nothing"), "Why: 5 of 12 modes fit nothing."),
        (
            BaselineCheck(tests=(MistakenTest("t4", "a wrong clock"),)),
            "without test t4. Find out within a week",
        ),
    ],
)
def test_a_baseline_that_does_not_fit_is_a_warning(check: BaselineCheck, said: str) -> None:
    (warning,) = open_warnings(HANGER_3, check)
    assert warning.startswith("Hanger 3: its baseline ")
    assert said in warning


def test_a_mode_is_a_warning_from_the_third_test_on_that_has_it_wrong() -> None:
    twice = RepeatedMistake("transverse", 3, SINCE, 2)
    assert open_warnings(HANGER_3, None, latest=latest(mistaken=(twice,))) == ()
    (warning,) = open_warnings(HANGER_3, None, latest=latest(mistaken=(replace(twice, tests=3),)))
    assert warning == (
        "Hanger 3: transverse 3 has not fitted the other modes since 2026-05-01. Check its number "
        "at the next planned test."
    )


def test_a_baseline_that_stands_alone_is_a_warning() -> None:
    assert open_warnings(HANGER_3, None, latest=latest(against_baseline=2)) == ()
    (warning,) = open_warnings(HANGER_3, None, latest=latest(against_baseline=6))
    assert "the 6 tests since the baseline agree with each other" in warning
    called = latest(against_baseline=6, evidence_years=1e4)
    assert open_warnings(HANGER_3, None, latest=called) == (), "it is told as a change"


def test_a_tension_far_off_the_nominal_one_stands_out_only_beside_neighbours_that_are_not() -> None:
    assert "% above nominal, unlike its neighbours" in row(1.05, 0.97, 1.41, 1.0, 1.02)
    assert "% below nominal, unlike its neighbours" in row(1.05, 0.97, 0.62, 1.0, 1.02)
    assert row(1.05, 0.97, 1.2, 1.0, 1.02) == ""
    assert row(1.4, 1.5, 1.41, 1.38, 1.45) == "", "all are off: the nominal tensions are"
    assert row(1.05, 0.97, 1.41, 1.0, families="abaa") != ""
    assert row(1.05, 0.97, 1.41, 1.0, families="bbab") == "", "none is of its kind"


def test_a_tension_that_is_hardly_known_stands_out_by_nothing() -> None:
    hangers = [replace(HANGER_3, id=n) for n in range(4)]
    known = {0: tension(1.0), 1: tension(1.02), 3: tension(0.98)}
    assert standing_out(hangers[2], hangers, {**known, 2: tension(1.4)}) != ""
    assert standing_out(hangers[2], hangers, {**known, 2: tension(1.4, 0.3)}) == ""
    assert standing_out(hangers[2], hangers, known) == ""


def test_with_an_open_warning_no_hanger_is_quiet_and_an_alert_stays_one() -> None:
    quiet, loud = [a_drift(probability=0.01)], [a_drift(probability=0.99)]
    for is_first in (True, False):
        given = {"is_first": is_first, "is_called": False}
        assert status_of(quiet, HANGER_3, **given, warnings=["x"]) is Status.CHECK
        assert status_of(quiet, HANGER_3, **given) in (Status.FIRST, Status.STEADY)
        assert status_of(loud, HANGER_3, **given, warnings=["x"]) is Status.ALERT


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        (("beyond threshold",), Status.ALERT),
        (("sudden change",), Status.WATCH),
        (("tests disagree",), Status.WATCH),
        (("gap",), Status.WATCH),
        (("held",), Status.WATCH),
        (("repeat the test",), Status.WATCH),
        ((), Status.WATCH),  # what the row said is lost
        (("check the modes",), Status.CHECK),
        (("check the baseline",), Status.CHECK),
    ],
)
def test_beside_an_alert_that_stands_no_hanger_is_quiet(
    kinds: tuple[AlertKind, ...], expected: Status
) -> None:
    alert = Alert("k", 3, "t2", SINCE, "fell", (), kinds)
    quiet = [a_drift(probability=0.04)]
    for is_first in (True, False):
        given = {"is_first": is_first, "is_called": False, "standing": findings([alert])}
        assert status_of(quiet, HANGER_3, **given) is expected


def test_a_trial_of_the_hooks_says_nothing_of_a_hanger() -> None:
    notice = Alert("k", 3, "t2", SINCE, "repeat it", (), ("repeat the test",))
    assert findings([notice, replace(notice, kinds=("test",))]) == (notice,)
