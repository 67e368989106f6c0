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
    describe,
    draw_loosening,
    hourly,
    largest_loosening,
    loosened,
    true_tension,
)
from tests.worlds.road_bridge_seasons import SIDE, bridge
from tests.worlds.tensioned_bars import PLANES, Masses, Plane

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
        solver, springs = Plane(hanger.bar, plane), tuple(hanger.springs[p])
        masses = Masses((0.6,), (min(0.3 * hanger.bar.length_m, 3.5),))
        wanted = [
            solver.solve(hanger.tension_n * part, springs, masses=masses, count=1)[0]
            for part in (0.99, 1.0)
        ]
        assert after == pytest.approx(wanted[0] / wanted[1], abs=4e-5)


def test_true_tension_follows_losses_and_temperature() -> None:
    moments = [EPOCH + timedelta(hours=h) for h in range(24 * 30)]
    quiet = true_tension(2, 6, moments)
    slow = true_tension(2, 6, moments, [Change("tension_loss", 6, AT, 0.02, over_days=10)])
    assert slow[:300] == pytest.approx(quiet[:300])
    assert slow[-1] / quiet[-1] == pytest.approx(0.98)
    assert 1e-3 < np.ptp(quiet) / quiet.mean() < 0.2


def test_an_end_loosens_in_one_plane_by_its_size() -> None:
    change = draw_loosening(2, AT, 0.057)
    number, plane = change.hanger, change.planes[0]
    quiet, changed = hourly(2, number, DAYS), hourly(2, number, DAYS, [change])
    before, after = _ratio(changed, quiet, plane)
    assert before == pytest.approx(1.0, abs=1e-12)
    assert after == pytest.approx(1 - 0.057, abs=6e-3)
    other = np.concatenate(_ratio(changed, quiet, PLANES[1 - PLANES.index(plane)]))
    assert other == pytest.approx(1.0, abs=1e-12)


def test_an_end_that_cannot_loosen_so_far_is_refused() -> None:
    number = max(
        range(2 * SIDE), key=lambda each: -largest_loosening(2, each, "longitudinal", "deck")
    )
    assert largest_loosening(2, number, "longitudinal", "deck") > 0
    with pytest.raises(ValueError, match="moves the first mode by less"):
        loosened(2, number, "longitudinal", "deck", 0.3)


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


def test_a_silent_logger_says_nothing() -> None:
    silent = Logger(silent_from=AT, silent_days=60.0)
    found = hourly(5, 9, 0.3, logger=silent)
    gaps = np.diff([each["time"].timestamp() for each in found]) / 86400
    assert gaps.max() == pytest.approx(60, abs=0.2)
    assert (np.sort(gaps)[:-1] < 0.5).all()


def test_describe_states_the_section() -> None:
    for own, hanger in zip(describe(2, range(24)), bridge(2), strict=True):
        assert own["area_m2"] == pytest.approx(hanger.bar.area_m2, rel=0.05)
        assert own["mass_kg_m"] == pytest.approx(hanger.bar.mass_kg_m, rel=0.05)


def test_a_change_is_one_that_the_world_knows() -> None:
    with pytest.raises(ValueError, match="no such change"):
        Change("flood", 1, AT, 0.1)
    with pytest.raises(ValueError, match="3 years"):
        hourly(2, 1, 1.0, start=EPOCH - timedelta(days=1))
