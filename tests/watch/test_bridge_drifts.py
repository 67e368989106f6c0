"""Small shifts that no hanger's watch calls, seen over the bridge."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from shm.values import Drift
from shm.watch.neighbours import BridgePattern, bridge_pattern, shifts_of
from shm.watch.options import WatchOptions
from shm.watch.watcher import watched
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import TENSION_ALONE, History, columns

HANGERS = range(1, 9)
LOSER, NEIGHBOURS = 5, (3, 4, 6, 7)
LOSS, GAIN = -0.05, 0.005
CHANGE_AT = 16
OPTIONS = WatchOptions(baseline_tests=8)


def drifts(hanger: int, seed: int, shift: float) -> tuple[Drift, ...]:
    """After thirty tests at about the same times as the other hangers'."""
    history = History(
        tests=30,
        days_between=1.0,
        scatter=0.002,
        outliers=0,
        change_at=CHANGE_AT,
        step=[math.log1p(shift)],
    )
    own = replace(HANGER_3, id=hanger)
    readings = history.readings(100 * seed + hanger)
    return watched(readings, TENSION_ALONE, columns(), own, OPTIONS).tests[-1].drifts


def bridge(seed: int, shifts: dict[int, float]) -> BridgePattern:
    found = {hanger: drifts(hanger, seed, shifts.get(hanger, 0.0)) for hanger in HANGERS}
    return bridge_pattern(shifts_of(found, tuple(HANGERS)))


@pytest.mark.slow
def test_the_shifts_of_neighbours_that_took_up_half_a_percent_each_are_found() -> None:
    pattern = bridge(1, {LOSER: LOSS, **dict.fromkeys(NEIGHBOURS, GAIN)})
    rows = {row.hanger: row for row in pattern.rows}

    assert rows[LOSER].way == "lost"
    for hanger in NEIGHBOURS:
        assert rows[hanger].low_fraction > -0.002
        assert rows[hanger].shift_fraction == pytest.approx(GAIN, abs=0.004)


def test_a_bridge_on_which_nothing_moved_is_not_accused() -> None:
    pattern = bridge(3, {})

    assert pattern.explanations[0].name == "no change"
    assert all(row.way == "unchanged" for row in pattern.rows)
