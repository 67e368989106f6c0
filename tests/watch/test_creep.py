"""Slow relaxation is a rate that is reported, and no alarm."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.values import CreepRate
from shm.watch.words.alert_text import watch_words
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import History, watch_of

RELAXES = History(tests=80, days_between=30.0, change_at=0, ramp=(-0.003,), outliers=0.0)


def test_a_hanger_that_relaxes_slowly_gets_a_rate_and_no_alarm() -> None:
    """Six years at 0.3 % a year: the rate within its own interval, and nothing called."""
    watch = watch_of(RELAXES.readings(1), RELAXES.quantities)
    creep = watch.tests[-1].creep_per_year
    assert watch.calls == ()
    assert creep is not None
    assert creep.is_known
    assert creep.mean == pytest.approx(-0.003, abs=2 * creep.sd)
    assert "Tension relaxes by 0." in watch_words(watch.tests, HANGER_3)


def test_a_few_tests_do_not_show_a_rate() -> None:
    few = replace(RELAXES, tests=4)
    creep = watch_of(few.readings(1), few.quantities).tests[-1].creep_per_year
    assert creep is not None
    assert not creep.is_known
    assert creep.sd == pytest.approx(creep.prior_sd, rel=0.05)
    assert creep.words == ""


def test_no_rate_is_given_while_a_change_is_likelier_than_none() -> None:
    lost = replace(RELAXES, tests=30, change_at=20, ramp=(0.0,), step=(-0.08,))
    watch = watch_of(lost.readings(1), lost.quantities)
    likely = [each for each in watch.tests if each.change.called]
    assert likely
    assert likely[0].creep_per_year is None


@pytest.mark.parametrize(
    ("creep", "words"),
    [
        (CreepRate(-0.003, 0.0006, 0.002), "Tension relaxes by 0.30 ± 0.10 % a year."),
        (CreepRate(0.003, 0.0006, 0.002), "Tension grows by 0.30 ± 0.10 % a year."),
        (CreepRate(-0.0003, 0.0006, 0.002), "Tension creeps by -0.03 ± 0.10 % a year, if at all."),
        (CreepRate(-0.003, 0.0015, 0.002), ""),
    ],
)
def test_a_rate_is_said_where_the_tests_show_it(creep: CreepRate, words: str) -> None:
    assert creep.words == words
