"""What still stands of an alert after works, where it names no quantity: by its frequencies."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from shm.values import Alert, Change, ModalTest
from shm.watch.engine.readings import Reader
from shm.watch.repair_check import share_left, unrepaired
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import frequencies, measured, posterior

WHEN = datetime(2026, 5, 1, tzinfo=UTC)
BASE = (1.0, 1.0, 7.0, 7.0, 7.0, 7.0)


def scaled(name: str, by: float) -> ModalTest:
    """All frequencies multiplied, as a section that is lost does to none alike."""
    test = replace(measured(frequencies(BASE)), id=name)
    modes = tuple(
        replace(mode, frequency_hz=mode.frequency_hz * by ** (1 / mode.order))
        for mode in test.modes
    )
    return replace(test, modes=modes)


@pytest.mark.parametrize(("by", "left"), [(0.98, 1.0), (1.0, 0.0), (0.98**0.25, 0.25)])
def test_the_share_that_is_left_is_what_the_frequencies_are_off_the_same_way(
    by: float, left: float
) -> None:
    baseline, told = [scaled("b", 1.0)], scaled("t", 0.98)
    assert share_left(baseline, told, [scaled("n", by)]) == pytest.approx(left, abs=1e-9)


def test_without_a_mode_in_common_nothing_is_known() -> None:
    empty = replace(scaled("n", 1.0), modes=())
    assert math.isnan(share_left([scaled("b", 1.0)], scaled("t", 0.98), [empty]))


@pytest.mark.parametrize(("by", "stands"), [(0.98, True), (0.999, False)])
def test_of_an_alert_without_a_quantity_the_frequencies_must_have_come_back(
    by: float, stands: bool
) -> None:
    change = Change(500, 100, 0.99, 0.9, WHEN, WHEN, ())
    alert = Alert("k", 3, "t", WHEN, "a section is lost", (), ("sudden change",), change)
    baseline = [scaled("b", 1.0)]
    before = Reader(posterior(BASE), baseline, HANGER_3), baseline
    since = [(scaled("n", by), WHEN)]
    told = [(4, alert, scaled("t", 0.98)), (5, replace(alert, change=None), None)]
    found = unrepaired(before, told, since, HANGER_3, restores=True)
    assert [each.alert for each in found] == [4] * stands
    if stands:
        assert found[0].words == "100 % of what the frequencies had moved by is left"
