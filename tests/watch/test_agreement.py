"""Two tests that agree are told, whatever their clocks say and in whatever order they came."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache

import numpy as np
import pytest

from shm.inference import UpdateOptions
from shm.models import build
from shm.values import Alert, Beside, ModalTest, Posterior, Thresholds
from shm.watch import Newest, WatchOptions, watch_newest
from tests.helpers import quick_update
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import modelled_test

BEGIN = datetime(2026, 1, 5, tzinfo=UTC)
SECOND = timedelta(seconds=1)
LOST = 0.85


def a_test(number: int, tension: float = LOST, temperature_c: float = 12.0) -> ModalTest:
    """Dated a second after the one before it: the sequential test has no time for a change."""
    test = modelled_test(f"t{number}", HANGER_3, tension=tension)
    noise = np.random.default_rng(number).standard_normal(len(test.modes))
    modes = tuple(
        replace(mode, frequency_hz=hz, frequency_sd_hz=3e-4 * hz)
        for mode, z in zip(test.modes, noise.tolist(), strict=True)
        for hz in [mode.frequency_hz * (1 + 3e-4 * z)]
    )
    return replace(test, modes=modes, time=BEGIN + number * SECOND, temperature_c=temperature_c)


HANGER = replace(HANGER_3, thresholds=Thresholds())


def baseline_of(first: ModalTest) -> tuple[Posterior, list[tuple[ModalTest, datetime]]]:
    options = UpdateOptions(samples=200, seed=1)
    return quick_update.update([first], build("beam1", HANGER_3), options), [(first, BEGIN)]


@cache
def sound_baseline() -> tuple[Posterior, list[tuple[ModalTest, datetime]]]:
    return baseline_of(a_test(0, 1.0))


def watch(newest: ModalTest, beside: Beside | None) -> Newest:
    dated = [(newest, newest.time or BEGIN)]
    found = watch_newest(*sound_baseline(), dated, HANGER, WatchOptions(), beside=beside)
    assert found is not None
    return found


def told(newest: ModalTest, beside: Beside) -> Alert | None:
    """What is told of two tests that agree; a request to repeat one that fits nothing is none."""
    alert = watch(newest, beside).alert
    return None if alert and alert.kinds == ("repeat the test",) else alert


def came(*before: ModalTest, after: Sequence[ModalTest] = ()) -> Beside:
    return Beside(came=(before, after))


def test_the_second_of_two_is_told_and_says_which_and_how_far() -> None:
    alert = told(a_test(2), came(a_test(1)))
    assert alert is not None
    assert alert.kinds == ("beyond threshold",)
    assert alert.drifts[0].shift_mean == pytest.approx(-0.15, abs=0.03)
    assert alert.drifts[0].probability > 0.95
    assert alert.key == "hanger-3:two-tests-agree:tension-down:t2"
    assert "Tests t1 and t2 both read beyond its threshold of 5 %." in alert.message
    assert "Hanger 3: tension fell by" in alert.message


@pytest.mark.parametrize(
    "beside",
    [
        Beside(came=([a_test(1)], [])),
        Beside(came=([], [a_test(1)])),
        Beside(dated=([a_test(1)], [])),
        Beside(dated=([], [a_test(1)])),
        Beside(came=([a_test(1, 1.0)], []), dated=([], [a_test(3)])),
    ],
)
def test_it_may_stand_on_either_side_in_either_order(beside: Beside) -> None:
    assert told(a_test(2), beside) is not None


@pytest.mark.parametrize(
    ("newest", "beside"),
    [
        (a_test(2), came()),  # it may be a blunder
        (a_test(2), came(a_test(1, 1.0), a_test(3))),  # a sound one came between
        (a_test(2), came(a_test(1, 1.1))),  # the other way
        (a_test(2), came(a_test(1, 0.6))),  # of quite another size
        (a_test(2, 0.96), came(a_test(1, 0.96))),  # below the threshold
        (a_test(2, 0.92), came(a_test(1, 0.92))),  # a van may do that for a visit
        (a_test(2, 0.93, 45.0), came(a_test(1, 0.93, 45.0))),  # it may be the warmth
        (a_test(2, 1.0), came(a_test(1), a_test(3))),  # itself sound
    ],
)
def test_what_is_no_second_test_of_a_shift_is_not_told(newest: ModalTest, beside: Beside) -> None:
    assert told(newest, beside) is None


def test_what_an_earlier_visit_showed_is_not_new() -> None:
    earlier = replace(a_test(1), time=BEGIN - timedelta(days=30))
    assert told(a_test(3), came(a_test(2))) is not None
    assert told(a_test(3), came(a_test(2), earlier)) is None


def test_a_held_test_is_named_as_one() -> None:
    alert = told(a_test(2), replace(came(a_test(1)), held=["t1"]))
    assert alert is not None
    assert "Tests t1 (held for its clock) and t2 both" in alert.message


def test_a_second_test_that_agrees_with_none_is_asked_to_be_repeated() -> None:
    alert = watch(a_test(2), came(a_test(1, 1.1))).alert
    assert alert is not None
    assert alert.kinds == ("repeat the test",)


def test_tests_of_later_visits_are_the_watchs_to_judge() -> None:
    """Of tests a month apart none is told for agreeing. Three of them doubt a baseline of one."""
    apart = [replace(a_test(n), time=BEGIN + n * timedelta(days=30)) for n in range(1, 6)]
    baseline = sound_baseline()
    kept: bytes | None = None
    before: ModalTest | None = None
    alerts = []
    for test in apart:
        beside = came(*([before] if before else []))
        found = watch_newest(
            *baseline, [(test, test.time or BEGIN)], HANGER, WatchOptions(), kept, beside
        )
        assert found is not None
        kept, before = found.kept, test
        alerts.append(found.alert and found.alert.key)
    assert alerts == [
        "hanger-3:repeat-the-test:t1",
        None,
        "hanger-3:check-the-baseline:t3",
        None,
        None,
    ]
