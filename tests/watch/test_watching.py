"""The watch of a hanger as a whole, and the stiffness of its ends by a posterior."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache

import numpy as np

from shm.models import THESIS, build
from shm.values import PLANES, ModalTest, Mode, Posterior, Thresholds
from shm.watch import (
    Newest,
    Watched,
    WatchOptions,
    end_stiffness,
    watch_hanger,
    watch_newest,
)
from shm.watch.watching import replay
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import posterior

BEGIN = datetime(2026, 1, 5, tzinfo=UTC)
SD, MODES = 2e-4, 6
SOUND = (1.0, 1.0, 7.3, 7.1, 7.2, 7.4)
BASELINE_TESTS = 3


def _test(number: int, theta: tuple[float, ...], rng: np.random.Generator) -> ModalTest:
    exact = build("beam2", HANGER_3, THESIS).frequencies_hz(np.array([theta]), MODES)[0]
    modes = tuple(
        Mode(plane, order + 1, float(hz * (1 + SD * rng.standard_normal())), float(hz * SD))
        for plane, row in zip(PLANES, exact, strict=True)
        for order, hz in enumerate(row)
    )
    time = BEGIN + timedelta(weeks=2 * number)
    warmth_c = np.nan if number == BASELINE_TESTS + 1 else 10.0
    return ModalTest(id=f"t{number}", hanger=3, modes=modes, time=time, temperature_c=warmth_c)


@cache
def _baseline() -> tuple[Posterior, tuple[ModalTest, ...]]:
    rng = np.random.default_rng(1)
    tests = tuple(_test(number, SOUND, rng) for number in range(BASELINE_TESTS))
    return posterior(SOUND, "beam2"), tests


def _dated(tests: tuple[ModalTest, ...]) -> list[tuple[ModalTest, datetime]]:
    return [(test, test.time) for test in tests if test.time is not None]


def _watched(*later: tuple[float, ...]) -> Watched:
    baseline, tests = _baseline()
    rng = np.random.default_rng(2)
    since = tuple(_test(BASELINE_TESTS + k, theta, rng) for k, theta in enumerate(later))
    return watch_hanger(baseline, _dated(tests), _dated(since), HANGER_3, WatchOptions())


def test_a_test_older_than_the_baseline_is_compared_with_it_all_the_same() -> None:
    baseline, tests = _baseline()
    old, since = _dated(tests[:1]), _dated(tests[1:])
    found = watch_hanger(baseline, since, old, HANGER_3, WatchOptions())
    assert found.latest.test == "t0"
    assert found.latest.time == tests[-1].time


def test_a_solid_class_is_watched_by_the_rotational_stiffness_of_its_faces() -> None:
    names = ("theta_F", "log10_k1", "log10_k2", "log10_k3", "log10_k4")
    samples = np.column_stack([np.ones(100), np.full((100, 4), 8.0)])
    known = replace(_baseline()[0], priors=THESIS)
    solid = replace(known, model="solid2", names=names, samples=samples)
    found = end_stiffness(solid, HANGER_3)
    spacing, thickness, width = 0.0425, 0.040, 1.0644
    thin = 2e8 / spacing * (width * thickness**2 / 4 + thickness**3 / 12)
    wide = 2e8 / spacing * (width**3 / 12 + thickness * width**2 / 4)
    expected = np.log10(2 / (1 / thin + 1 / wide))
    assert list(found) == ["transverse_end_stiffness", "longitudinal_end_stiffness"]
    np.testing.assert_allclose(list(found.values()), expected)


def test_a_hanger_may_have_its_own_mean_time_to_a_false_call() -> None:
    baseline, tests = _baseline()
    own = replace(HANGER_3, thresholds=Thresholds(false_call_years=7.0))
    found = watch_hanger(baseline, _dated(tests), [], own, WatchOptions(limit_years=50.0))
    assert found.latest.change.limit_years == 7.0
    common = watch_hanger(baseline, _dated(tests), [], HANGER_3, WatchOptions(limit_years=50.0))
    assert common.latest.change.limit_years == 50.0


LOST = (0.93, *SOUND[1:])


def _newest(later: list[tuple[ModalTest, datetime]], kept: bytes | None = None) -> Newest | None:
    baseline, tests = _baseline()
    return watch_newest(baseline, _dated(tests), later, HANGER_3, WatchOptions(), kept)


def _later(*thetas: tuple[float, ...]) -> list[tuple[ModalTest, datetime]]:
    rng = np.random.default_rng(2)
    return _dated(tuple(_test(BASELINE_TESTS + k, theta, rng) for k, theta in enumerate(thetas)))


def test_going_on_test_by_test_from_what_was_kept_finds_the_same() -> None:
    later = _later(SOUND, SOUND, LOST, LOST, LOST)
    whole = _watched(SOUND, SOUND, LOST, LOST, LOST)
    kept, alerts = None, []
    for test in later:
        found = _newest([test], kept)
        assert found is not None
        kept = found.kept
        alerts += [found.alert] if found.alert else []
    assert found.test.drifts == whole.latest.drifts
    assert found.test.change == whole.latest.change
    at_once = _newest(later)
    assert at_once is not None
    assert at_once.test.change == whole.latest.change
    assert tuple(alerts) == replay(whole.watch.tests, HANGER_3)[1]
    assert len(alerts) == 1
