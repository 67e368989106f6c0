"""A test that no state of the baseline's model explains: no shift, no state, no "no change"."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache

import numpy as np

from shm.inference import UpdateOptions, update
from shm.models import DESCRIPTION, THESIS, build
from shm.report.contents import HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_report import facts
from shm.report.hanger_status import Status
from shm.report.hanger_summary import HangerSummary, LatestTest
from shm.report.open_warnings import open_warnings
from shm.report.states import states_over_time
from shm.values import NAN, PLANES, FloatArray, ModalTest, Mode
from shm.watch import Watched, WatchOptions, watch_hanger
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import averaged, with_now

BEGIN = datetime(2026, 1, 5, tzinfo=UTC)
# In percent of each mode: what no tension and no end stiffness does.
OTHER_BAR = np.array([[4, -4, 4, -4, 4, -4], [-4, 4, -4, 4, -4, 4]])


def modal_test(number: int, off_percent: FloatArray) -> ModalTest:
    theta = np.array([(1.0, 1.0, 7.3, 7.1, 7.2, 7.4)])
    hz = build("beam2", HANGER_3, THESIS).frequencies_hz(theta, 6)[0] * (1 + off_percent / 100)
    modes = tuple(
        Mode(plane, order, float(value), float(value) * 2e-4)
        for plane, row in zip(PLANES, hz, strict=True)
        for order, value in enumerate(row, start=1)
    )
    time = BEGIN + timedelta(weeks=2 * number)
    return ModalTest(f"t{number}", modes, 3, time, temperature_c=10.0)


@cache
def watched() -> Watched:
    """One test of the baseline, and one of another bar."""
    first, other = modal_test(0, np.zeros((2, 6))), modal_test(1, OTHER_BAR)
    baseline = update(
        [first], build("beam2", HANGER_3, DESCRIPTION), UpdateOptions(samples=300, seed=1)
    )
    of_first, of_other = [(first, BEGIN)], [(other, BEGIN + timedelta(weeks=2))]
    return watch_hanger(baseline, of_first, of_other, HANGER_3, WatchOptions())


def test_told_is_unknown_if_unexplained() -> None:
    latest = watched().latest
    assert not latest.change.called
    assert all(math.isnan(each.shift_mean) for each in latest.published_drifts)
    assert all(math.isnan(each.probability) for each in latest.published_drifts)


def test_told_keeps_probable_shift() -> None:
    """A loss that is probable is reported although the modes fit no state."""
    latest = watched().latest
    drifts = tuple(replace(each, probability=0.9) for each in latest.drifts)
    probable = replace(latest, drifts=drifts)
    assert probable.is_unexplained
    assert probable.published_drifts == drifts


def test_states_omit_unexplained_tests() -> None:
    states = states_over_time(watched(), HANGER_3)
    (tension,) = (each for each in states.quantities if each.is_tension)
    for band in (tension.read, tension.filtered, tension.smoothed):
        assert np.isfinite(band.middle).tolist() == [True, False]


def test_hanger_message_doubts_unexplained_test() -> None:
    latest = watched().latest
    warnings = open_warnings(HANGER_3, None, latest=latest)
    tension = averaged(Interval.normal(711e3, 5e3))
    of_test = LatestTest(latest.test, BEGIN, tension)
    message = HangerSummary(
        HANGER_3, of_test, drifts=latest.published_drifts, warnings=warnings
    ).message
    assert message.status is Status.CHECK
    assert message.urgency == "week"
    assert "explains its latest test" in message.words


def test_report_gives_no_unknown_shift(season: HangerReport) -> None:
    drifts = tuple(replace(each, shift_mean=NAN, probability=NAN) for each in season.drifts)
    unknown = replace(with_now(season, drifts=drifts, standing=()), alerts=())
    assert unknown.now.change is None
    values = {what: value for what, value, _ in facts(unknown)}
    assert values["Since the baseline"] == "not known"
