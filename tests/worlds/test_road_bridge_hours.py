"""The road bridge under permanent sensors: tension, loosened ends, errors, silences."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import numpy as np
import pytest

from tests.worlds.road_bridge_hours import (
    EPOCH,
    Change,
    Logger,
    hourly,
)
from tests.worlds.road_bridge_seasons import PLANES, bridge

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

DAYS = 30 / 365.25
AT = EPOCH + timedelta(days=15)


def _read(readings: list[dict[str, Any]], plane: str, order: int, key: str) -> dict[Any, float]:
    return {
        each["time"]: mode[key]
        for each in readings
        for mode in each["modes"]
        if (mode["plane"], mode["order"]) == (plane, order)
    }


def _ratio(changed: Any, quiet: Any, plane: str, order: int = 1) -> tuple[Any, Any]:
    """Return the ratios of true frequencies before and after `AT`."""
    a, b = (_read(each, plane, order, "true_hz") for each in (changed, quiet))
    assert a.keys() == b.keys()
    before, after = (
        np.array([a[t] / b[t] for t in a if (t >= AT) == late]) for late in (False, True)
    )
    return before, after


def test_a_loss_of_tension_lowers_all_modes_as_the_bar_does() -> None:
    changes = [Change("tension_loss", 6, AT, 0.01)]
    quiet, changed = hourly(2, 6, DAYS), hourly(2, 6, DAYS, changes)
    hanger = bridge(2)[6]
    for p, plane in enumerate(PLANES):
        before, after = _ratio(changed, quiet, plane)
        assert before == pytest.approx(1.0, abs=1e-12)
        solver, springs = hanger.bar.plane(p), tuple(hanger.springs[p])
        masses = [(min(0.3 * hanger.bar.length_m, 3.5), 0.6)]
        wanted = [
            solver.solve(hanger.tension_n * part, springs, masses=masses, count=1)[0]
            for part in (0.99, 1.0)
        ]
        assert after == pytest.approx(wanted[0] / wanted[1], abs=4e-5)


def test_errors_follow_the_recorded_minutes() -> None:
    for minutes in (60.0, 6.0):
        found = hourly(3, 4, 0.3, logger=Logger(minutes=minutes))
        read, true, sd = (
            _read(found, "transverse", 2, key)
            for key in ("frequency_hz", "true_hz", "frequency_sd_hz")
        )
        z = np.array([(read[t] - true[t]) / sd[t] for t in read])
        spread = np.subtract(*np.percentile(z, [84.13, 15.87])) / 2
        assert 0.75 < spread < 1.5
    hour = _read(hourly(3, 4, 0.01), "transverse", 2, "frequency_sd_hz")
    short = _read(hourly(3, 4, 0.01, logger=Logger(6.0)), "transverse", 2, "frequency_sd_hz")
    for time in hour:
        assert short[time] / hour[time] == pytest.approx(np.sqrt(10), rel=0.02)


def test_an_hour_is_the_same_whatever_stretch_is_asked_for() -> None:
    late = EPOCH + timedelta(days=40)
    part = hourly(5, 9, 0.02, start=late)
    whole = [each for each in hourly(5, 9, 0.2) if each["time"] >= late][: len(part)]
    assert part == whole
