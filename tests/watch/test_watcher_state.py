"""The state of a watch that is kept between two tests, and what makes it void."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from shm.errors import BadInput
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.engine.options import WatchOptions
from shm.watch.state_sums import WatchState
from shm.watch.watcher import Watcher
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import (
    PLANES_ALONE,
    History,
    columns,
    watcher,
)

OPTIONS = WatchOptions(baseline_tests=4)
WATCHER = watcher(PLANES_ALONE, OPTIONS)


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
    stricter = Watcher(
        PLANES_ALONE, columns(len(PLANES_ALONE)), replace(HANGER_3, thresholds=limits), OPTIONS
    )
    assert stricter.key == WATCHER.key


def test_a_state_cut_short_is_refused() -> None:
    state, _ = WATCHER.begin(History(PLANES_ALONE, 4).readings(3))
    content = to_bytes(state)

    with pytest.raises(BadInput, match="cannot be read"):
        from_bytes(WatchState, content[: len(content) // 2])
