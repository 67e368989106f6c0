"""The simulated years of the drift benchmark are what they say, and its rules count as they say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from shm.values import TENSION, ModalTest
from tests.benchmarks.drift.comparing import FalseAlarms, delays, false_alarms, tuned
from tests.benchmarks.drift.frequencies import error
from tests.benchmarks.drift.outcomes import (
    CUSUM,
    OPEN,
    OURS,
    RIGHT,
    WRONG,
    WRONG_END,
    Outcome,
    read,
    verdict,
    written,
)
from tests.benchmarks.drift.rivals import cusum, standardised, without_swing
from tests.benchmarks.drift.scenarios import QUIET, SCENARIOS
from tests.benchmarks.drift.years import SimulatedHanger, simulated_hanger, years_of

PLANE_OF = {
    TENSION: None,
    "log10_k1": "transverse",
    "log10_k3": "transverse",
    "log10_k2": "longitudinal",
}


@pytest.fixture(scope="module")
def simulated() -> SimulatedHanger:
    return simulated_hanger(3)


def test_frequencies_between_the_nodes_are_those_of_the_elements(
    simulated: SimulatedHanger,
) -> None:
    rng = np.random.default_rng(5)
    off = error(simulated.hanger, simulated.state, simulated.deviations, 6, rng)
    assert off < 2e-6


def frequencies(test: ModalTest) -> list[float]:
    return [mode.frequency_hz for mode in test.modes]


def test_years_with_and_without_a_change_are_the_same_until_it_begins(
    simulated: SimulatedHanger,
) -> None:
    calm = years_of(simulated, QUIET, 5.0).tests
    for name in ("step5", "ramp2", "springs"):
        changed = years_of(simulated, SCENARIOS[name], 5.0).tests
        pairs = zip(map(frequencies, calm), map(frequencies, changed), strict=False)
        alike = [np.allclose(one, other, rtol=1e-9) for one, other in pairs]
        before = [test.time is not None and test.time <= simulated.began for test in changed]
        assert alike == before


def test_a_lost_spring_lowers_the_frequencies_of_its_plane_alone(
    simulated: SimulatedHanger,
) -> None:
    calm = years_of(simulated, QUIET, 5.0)
    changed = years_of(simulated, SCENARIOS["spring"], 5.0)
    ratios: dict[str, list[float]] = {"transverse": [], "longitudinal": []}
    for n, (a, b) in enumerate(zip(calm.tests, changed.tests, strict=False)):
        if a.time is not None and a.time > simulated.began and not calm.blunders[n]:
            for one, other in zip(a.modes, b.modes, strict=True):
                ratios[one.plane].append(other.frequency_hz / one.frequency_hz)
    other_plane = next(plane for plane in ratios if plane != simulated.plane)
    assert max(ratios[simulated.plane]) < 0.999
    assert np.allclose(ratios[other_plane], 1.0, atol=1e-3)


def test_tests_are_irregular_and_some_lack_a_temperature_or_modes(
    simulated: SimulatedHanger,
) -> None:
    tests = years_of(simulated, QUIET, 5.0).tests
    times = [test.time.timestamp() / 86400 for test in tests if test.time is not None]
    assert 90 < len(tests) < 160
    assert np.diff(times).max() > 60
    assert 0 < sum(math.isnan(test.temperature_c) for test in tests) < 0.1 * len(tests)
    assert 0.8 < np.mean([len(test.modes) for test in tests]) / 12 < 1


def test_a_cusum_adds_up_what_is_beyond_half_a_standard_deviation() -> None:
    assert cusum(np.array([1.5, np.nan, 1.5, -3.0])).tolist() == [1.0, 1.0, 2.0, 2.5]


def test_the_swing_with_the_temperature_is_taken_off() -> None:
    warmth = np.linspace(-20, 20, 60)
    tension = 0.01 + 0.001 * warmth
    tension[7] += 0.3
    rest = without_swing(tension, warmth, np.arange(60) < 40)
    assert np.abs(np.delete(rest, 7)).max() < 1e-12
    assert rest[7] == pytest.approx(0.3)


def test_a_baseline_leaves_its_outlier_out() -> None:
    values = np.array([0.0, 1, -1, 1, -1, 0, 100, 5])
    scaled = standardised(values, np.arange(8) < 7)
    assert np.isnan(scaled[:7]).all()
    assert scaled[7] == pytest.approx(5 / np.std([0, 1, -1, 1, -1, 0], ddof=1))


def made(statistic: tuple[float, ...], changed_at: int | None = None) -> Outcome:
    days = tuple(365.25 * (n + 1) for n in range(len(statistic)))
    named = ((TENSION,),) * len(days)
    return Outcome(
        1, QUIET.name, days, changed_at, {CUSUM: statistic, OURS: statistic}, named, (TENSION,)
    )


def test_years_count_until_the_first_false_alarm_or_the_change() -> None:
    alarm = made((0, 0, 5, 0))
    changed = made((0, 0, 0, 5), changed_at=3)
    found = false_alarms([alarm, changed], CUSUM, 4.0)
    assert (found.count, found.years) == (1, 6.0)


def test_delays_count_from_the_first_test_after_the_change() -> None:
    outcomes = [
        made((0, 0, 5, 0), changed_at=2),
        made((0, 0, 0, 5), changed_at=2),
        made((0, 0, 0, 0), changed_at=2),
        made((0, 5, 0, 0), changed_at=2),
    ]
    found = delays(outcomes, CUSUM, 4.0)
    assert found.tests == (1.0, 2.0, math.inf)
    assert found.spoilt == 1
    assert found.quantile(0.5) == 2.0
    assert math.isinf(found.quantile(0.9))


def test_a_limit_is_the_lowest_that_keeps_the_rate() -> None:
    quiet = [made((0, 1, float(height), 0)) for height in (2, 3, 4, 5)]
    limit = tuned(quiet, CUSUM, 1 / 12)
    assert limit == 4.0
    assert false_alarms(quiet, CUSUM, limit).count == 1
    assert false_alarms(quiet, CUSUM, np.nextafter(limit, 0)).rate > 1 / 12


def test_no_false_alarm_in_a_thousand_years_leaves_a_rate_below_one_in_five_hundred() -> None:
    low, high = FalseAlarms(0, 1000.0).interval
    assert low == 0.0
    assert 0.001 < high < 0.002


@pytest.mark.parametrize(
    ("named", "truth", "expected"),
    [
        ((TENSION,), (TENSION,), RIGHT),
        ((TENSION, "log10_k1"), (TENSION,), OPEN),
        (("log10_k1", TENSION), (TENSION,), OPEN),
        (("log10_k1",), (TENSION,), WRONG),
        (("log10_k1", "log10_k3"), ("log10_k1",), RIGHT),
        (("log10_k3",), ("log10_k1",), WRONG_END),
        (("log10_k1", "log10_k2"), ("log10_k1",), OPEN),
        (("log10_k2",), ("log10_k1",), WRONG),
        (("log10_k2",), ("log10_k1", "log10_k2"), RIGHT),
    ],
)
def test_what_was_named_is_held_against_the_truth(
    named: tuple[str, ...], truth: tuple[str, ...], expected: str
) -> None:
    assert verdict(named, truth, PLANE_OF) == expected


def test_an_outcome_comes_back_from_its_line() -> None:
    outcome = replace(made((0.0, math.inf), changed_at=1), plane_of={"log10_k1": "transverse"})
    assert read(written(outcome)) == outcome
