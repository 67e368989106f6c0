"""The watch without a model: what it tells of daily frequencies of which the truth is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.errors import BadInput
from shm.values import Hanger, ModalTest, Mode
from shm.watch import WatchedFrequencies, WatchOptions, watch_frequencies
from shm.watch.engine.frequencies import FrequencyReader
from shm.watch.frequency_watch import watch_newest_frequencies

START = datetime(2026, 5, 1, 12, tzinfo=UTC)
MODES = (("transverse", 1, 2.0), ("longitudinal", 1, 2.12), ("transverse", 2, 4.1))
"""Plane, order and frequency (Hz); the first two are a close pair."""
Moved = Callable[[int, float, int], float]


def unmoved(day: int, warmth_c: float, mode: int) -> float:
    return 0.0


def one_test(
    day: int, *, moved: Moved = unmoved, warmth_c: float = 15.0, seed: int = 0, noise: float = 4e-4
) -> ModalTest:
    """One test: `moved` gives the change of each log frequency."""
    draw = np.random.default_rng([seed, day])
    modes = tuple(
        Mode(
            plane, order, hz * math.exp(moved(day, warmth_c, j) + noise * draw.normal()), 4e-4 * hz
        )  # type: ignore[arg-type]
        for j, (plane, order, hz) in enumerate(MODES)
    )
    return ModalTest(f"d{day}", modes, 9, START + timedelta(days=day), warmth_c)


def daily(days: Sequence[int], moved: Moved = unmoved, *, seed: int = 0) -> list[ModalTest]:
    """Tests at the warmth of the season, from 25 C in summer to -5 C in winter."""
    return [
        one_test(
            day, moved=moved, seed=seed, warmth_c=10 + 15 * math.cos(2 * math.pi * (day - 80) / 365)
        )
        for day in days
    ]


def watch(tests: Sequence[ModalTest], baseline: int = 30) -> WatchedFrequencies:
    return watch_frequencies(tests, baseline_tests=baseline, name="Deck")


def from_day(first: int, *sizes: float) -> Moved:
    return lambda day, _, mode: sizes[mode] if day >= first else 0.0


# ---------------------------------------------------------------- what is told


def test_a_drop_of_all_frequencies_is_told_within_three_weeks_with_its_size() -> None:
    found = watch(daily(range(121), from_day(90, -0.02, -0.02, -0.02)))

    changes = [each for each in found.alerts if "sudden change" in each.kinds]
    assert len(changes) == 1
    told = changes[0]
    assert START + timedelta(days=90) <= told.time <= START + timedelta(days=111)
    assert told.message.startswith("The frequencies of Deck have dropped by ")
    assert told.change is not None
    first = told.change.moved[0]
    assert len(first.together) == len(MODES) - 1
    assert abs(first.shift_mean + 0.02) < 3 * first.shift_sd < 0.006


def test_the_one_frequency_that_dropped_is_named() -> None:
    found = watch(daily(range(121), from_day(90, 0.0, 0.0, -0.02)))

    told = next(each for each in found.alerts if "sudden change" in each.kinds)
    assert told.message.startswith("The frequency transverse 2 of Deck has dropped by ")
    shifts = {each.quantity: each.shift_mean for each in found.tests[-1].drifts}
    assert shifts["frequency transverse 2"] == pytest.approx(-0.02, abs=0.003)
    assert abs(shifts["frequency transverse 1"]) < 0.004


def test_nothing_is_told_where_nothing_changes() -> None:
    assert not watch(daily(range(150))).alerts


def test_the_first_frost_is_no_damage() -> None:
    def stiffened(day: int, warmth_c: float, mode: int) -> float:
        return -3e-4 * warmth_c - 2.5e-3 * (1 + mode / 4) * min(warmth_c, 0.0)

    tests = daily(range(60, 330), stiffened)
    swing = [math.log(each.modes[0].frequency_hz) for each in tests]
    assert max(swing) - min(swing) > 0.015  # as much as the losses above

    assert not [each for each in watch(tests).alerts if each.change]


def test_a_month_of_moisture_is_no_damage() -> None:
    def moist(day: int, _: float, mode: int) -> float:
        return -2.5e-3 if 100 <= day < 130 else 0.0

    assert not [each for each in watch(daily(range(150), moist)).alerts if each.change]


def test_a_structure_tested_once_a_month_waits_for_no_further_test() -> None:
    months = range(0, 30 * 16, 30)
    found = watch(daily(months, from_day(300, -0.04, -0.04, -0.04)), baseline=6)

    evidence = {each.test: each.change.evidence_years for each in found.tests}
    assert evidence["d270"] < 1 < 20 < evidence["d330"]  # the second test that shows it
    told = next(each for each in found.alerts if each.change)
    assert told.test == "d360"


def test_its_urgency_names_no_traffic_and_no_hammer() -> None:
    found = watch(daily(range(121), from_day(90, -0.06, -0.06, -0.06)))

    for alert in found.alerts:
        assert "within a week" in alert.message
        assert "traffic" not in alert.message
        assert "hammer" not in alert.message
    assert any("beyond threshold" in each.kinds for each in found.alerts)


# ---------------------------------------------------------------- reading


def test_two_close_modes_that_were_exchanged_are_put_right() -> None:
    reader = FrequencyReader([one_test(0, noise=0.0)])
    first, second, third = one_test(1, noise=0.0).modes
    exchanged = (
        replace(first, frequency_hz=second.frequency_hz),
        replace(second, frequency_hz=first.frequency_hz),
        third,
    )

    found = reader.reading([ModalTest("x", exchanged)], START).modes

    assert found is not None
    assert found.values == pytest.approx([0.0] * 3, abs=1e-9)


def test_orders_that_a_missing_mode_made_too_low_are_put_right() -> None:
    reader = FrequencyReader([one_test(0, noise=0.0)])
    _, second, third = one_test(1, noise=0.0).modes
    lower = (second, replace(third, order=1))  # transverse 1 was missed

    found = reader.reading([ModalTest("x", lower)], START).modes

    assert found is not None
    index = [*reader.modes].index(("transverse", 2))
    assert found.values[index] == pytest.approx(0.0, abs=1e-9)
    assert math.isinf(found.variances[[*reader.modes].index(("transverse", 1))])


def test_a_true_loss_of_one_mode_is_no_exchange() -> None:
    reader = FrequencyReader([one_test(0, noise=0.0)])
    lost = one_test(1, moved=lambda d, w, mode: -0.05 * (mode == 1), noise=0.0)

    found = reader.reading([lost], START).modes

    assert found is not None
    assert sorted(found.values) == pytest.approx([-0.05, 0.0, 0.0], abs=1e-9)


def test_first_tests_without_modes_are_refused() -> None:
    with pytest.raises(BadInput, match="no mode"):
        FrequencyReader([ModalTest("x", ())])


def test_tests_need_times_and_as_many_as_the_baseline() -> None:
    with pytest.raises(BadInput, match="no time"):
        watch([ModalTest("x", one_test(0).modes)], baseline=1)
    with pytest.raises(BadInput, match="fewer"):
        watch([one_test(0)], baseline=2)


# ---------------------------------------------------------------- going on


def dated(tests: Sequence[ModalTest]) -> list[tuple[ModalTest, datetime]]:
    return [(each, each.time) for each in tests if each.time is not None]


def test_watch_newest_frequencies_goes_on_from_what_was_kept() -> None:
    tests = dated(daily(range(100), from_day(80, -0.02, -0.02, -0.02)))
    given = tests[:30], Hanger.without_model(9), WatchOptions()
    kept, told = None, []
    for each in tests[30:]:
        found = watch_newest_frequencies(given[0], [each], *given[1:], kept)
        assert found is not None
        kept = found.kept
        told += [found.alert.message] if found.alert else []
    whole = watch_newest_frequencies(given[0], tests[30:], *given[1:])

    assert len(told) == 2
    assert whole is not None
    assert whole.kept == kept


def test_watch_newest_frequencies_begins_anew_with_another_baseline() -> None:
    tests, hanger = dated(daily(range(40))), Hanger.without_model(9)
    one = watch_newest_frequencies(tests[:30], tests[30:31], hanger, WatchOptions())

    assert one is not None
    again = watch_newest_frequencies(tests[:20], tests[31:], hanger, WatchOptions(), one.kept)
    assert again is None
