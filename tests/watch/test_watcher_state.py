"""The state of a watch that is kept between two tests, and what makes it void."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.values import Reading, WatchedTest
from shm.watch.kept_state import from_bytes, to_bytes
from shm.watch.options import WatchOptions
from shm.watch.state_sums import WatchState
from shm.watch.watcher import Watcher
from tests.helpers.comparing import assert_same
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import (
    PLANES_ALONE,
    SPRING_STEP,
    History,
    columns,
    watch_of,
    watcher,
)

OPTIONS = WatchOptions(baseline_tests=4)
WATCHER = watcher(PLANES_ALONE, OPTIONS)


def readings(tests: int = 12) -> list[Reading]:
    """With a change that is called on the way, and tests without a temperature."""
    step = [-0.08, -SPRING_STEP, 0.0]
    history = History(PLANES_ALONE, tests, change_at=7, step=step, temperatures_missing=0.3)
    return [
        each if np.isfinite(each.temperature_c) else softened(each) for each in history.readings(3)
    ]


def softened(given: Reading) -> Reading:
    """What a kelvin does is left in it, for want of a temperature."""
    assert given.modes is not None
    per_kelvin = np.full(len(given.modes.values), -1.5e-4)
    return replace(given, modes=replace(given.modes, per_kelvin=per_kelvin))


def by_kept_states(given: list[Reading]) -> tuple[WatchState, list[WatchedTest]]:
    """Each test of a watch that knows of the earlier ones by bytes alone."""
    state, begun = WATCHER.begin(given[: OPTIONS.baseline_tests])
    tests = list(begun.tests)
    for reading in given[OPTIONS.baseline_tests :]:
        kept = from_bytes(WatchState, to_bytes(state))
        again = watcher(PLANES_ALONE, OPTIONS)
        state, found = again.after(kept, reading)
        tests.append(found)
    return state, tests


def test_a_watch_from_kept_states_is_bit_for_bit_that_of_one_pass() -> None:
    given = readings()

    once = watch_of(given, PLANES_ALONE, OPTIONS)
    _, tests = by_kept_states(given)

    assert once.calls
    assert_same(list(tests), list(once.tests))


def test_the_key_goes_with_options_and_quantities_but_not_with_thresholds() -> None:
    tension, *others = PLANES_ALONE
    limits = replace(HANGER_3.thresholds, tension_shift_fraction=0.1)
    watchers = [
        WATCHER,
        watcher(PLANES_ALONE, replace(OPTIONS, limit_years=20)),
        watcher((tension,), OPTIONS),
        watcher((replace(tension, values=tension.values * 2), *others), OPTIONS),
    ]

    for one, other in itertools.combinations(watchers, 2):
        assert one.key != other.key
    stricter = Watcher(PLANES_ALONE, columns(), replace(HANGER_3, thresholds=limits), OPTIONS)
    assert stricter.key == WATCHER.key


def test_a_state_cut_short_is_refused() -> None:
    state, _ = WATCHER.begin(readings(4))
    content = to_bytes(state)

    with pytest.raises(BadInput, match="cannot be read"):
        from_bytes(WatchState, content[: len(content) // 2])
